#include "core/certificate/evidence/evidence.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/parallel.h"
#include "core/base/vector_ops.h"
#include "core/certificate/evidence/vertex_grid.h"
#include "core/geometry/reach_bound.h"
#include "core/index/runs.h"

namespace stellate::core {
namespace {

// Two sheets this number of sizes apart are nearer than the reach that a mesh of this size needs.
constexpr double kLook = 2.5;
constexpr std::uint64_t kPointsInPart = 1 << 8;
// The points of one search lie within this number of sizes of the first of them.
constexpr double kRunReach = 1;

// Whether the coordinates by which a VertexGrid sorts separate vertices that are far from each
// other: in more dimensions than those and one, they mostly do not.
bool DoesGridSeparate(const MeshView& mesh) { return mesh.k < 3 || mesh.d <= mesh.k + 1; }

class Comparison {
 public:
  Comparison(const MeshView& mesh, const std::vector<double>& longest_edge, double size,
             bool graded, double position_error)
      : mesh_(mesh),
        longest_edge_(longest_edge),
        size_(size),
        graded_(graded),
        position_error_(position_error) {}

  double SizeAt(std::uint32_t v) const {
    return graded_ ? std::min(size_, longest_edge_[v] * std::numbers::inv_sqrt3) : size_;
  }

  // Compares y with the vertices near it. `index`: of y in the evidence; `self`: the vertex that y
  // is, or kNoVertex. for_each_near(visit) calls visit(v, |y - v|^2) for each vertex nearer than
  // kLook sizes.
  template <typename ForEachNear>
  void Add(const double* y, std::uint64_t index, std::uint32_t self, std::vector<double>& step,
           Evidence* evidence, const ForEachNear& for_each_near) const {
    const int d = mesh_.d;
    step.resize(static_cast<std::size_t>(d));
    double nearest = INFINITY, nearest_size = size_;
    for_each_near([&](std::uint32_t v, double squared) {
      if (v == self) return;
      const double size = SizeAt(v);
      if (squared < nearest) {
        nearest = squared;
        nearest_size = graded_ ? std::min(size_, longest_edge_[v]) : size_;
      }
      if (squared > kLook * kLook * size * size) return;
      const double* p = mesh_.Point(v);
      const double* const tangent = mesh_.Tangent(v);
      const double along2 = WithDimension(d, [&](auto known) {
        const int n = known() > 0 ? known() : d;
        for (int i = 0; i < n; ++i) step[static_cast<std::size_t>(i)] = y[i] - p[i];
        double sum = 0;
        for (int a = 0; a < mesh_.k; ++a) {
          const double along = Dot(tangent + a * n, step.data(), n);
          sum += along * along;
        }
        return sum;
      });
      const double away2 = squared - along2, bound = 2 * kLook * size;
      // The bound |y - p|^2 / (2 away) is mostly larger than any that counts.
      if (!(away2 * bound * bound > squared * squared)) return;
      const double away = std::sqrt(away2), distance = std::sqrt(squared);
      if (!IsTelling(distance, away, longest_edge_[v], position_error_)) return;
      const double reach = ReachBound(squared, away);
      evidence->coarseness = std::max(evidence->coarseness, size / reach);
      if (reach >= evidence->reach) return;
      evidence->reach = reach;
      evidence->narrowest = index;
      evidence->vertex = v;
      evidence->distance = distance;
    });
    if (self == kNoVertex &&
        !(nearest <= kCoverageShare * kCoverageShare * nearest_size * nearest_size))
      evidence->uncovered.push_back(index);
  }

  static constexpr std::uint32_t kNoVertex = 0xffffffffu;

 private:
  const MeshView& mesh_;
  const std::vector<double>& longest_edge_;
  const double size_;
  const bool graded_;
  const double position_error_;
};

// The points to compare: the given ones, and each `stride`-th vertex.
struct Compared {
  const MeshView& mesh;
  const std::vector<double>& points;
  std::uint64_t stride;

  template <typename ForEachNear>
  void AddPoint(const Comparison& comparison, std::uint64_t i, std::vector<double>& step,
                Evidence* evidence, const ForEachNear& for_each_near) const {
    const double* const y = points.data() + i * static_cast<std::size_t>(mesh.d);
    comparison.Add(y, i, Comparison::kNoVertex, step, evidence,
                   [&](const auto& visit) { for_each_near(y, visit); });
  }
  template <typename ForEachNear>
  void AddVertex(const Comparison& comparison, std::uint32_t v, std::vector<double>& step,
                 Evidence* evidence, const ForEachNear& for_each_near) const {
    const double* const y = mesh.Point(v);
    comparison.Add(y, Evidence::kNone, v, step, evidence,
                   [&](const auto& visit) { for_each_near(y, visit); });
  }
};

// Compares point by point.
std::vector<Evidence> CompareByGrid(const Comparison& comparison, const Compared& compared,
                                    double look) {
  const VertexGrid grid(compared.mesh, look);
  const auto near = [&](const double* y, const auto& visit) { grid.ForEachAround(y, visit); };
  const std::uint64_t given = compared.points.size() / static_cast<std::size_t>(compared.mesh.d);
  const std::uint64_t all =
      given + (compared.mesh.vertices + compared.stride - 1) / compared.stride;
  std::vector<Evidence> parts((all + kPointsInPart - 1) / kPointsInPart);
  ParallelFor(parts.size(), [&](std::uint64_t part) {
    std::vector<double> step;
    for (std::uint64_t i = part * kPointsInPart; i < std::min(all, (part + 1) * kPointsInPart);
         ++i) {
      if (i < given)
        compared.AddPoint(comparison, i, step, &parts[part], near);
      else
        compared.AddVertex(comparison, static_cast<std::uint32_t>((i - given) * compared.stride),
                           step, &parts[part], near);
    }
  });
  return parts;
}

// Compares runs of near points, with one search for each.
std::vector<Evidence> CompareByRuns(const Comparison& comparison, const Compared& compared,
                                    double size, double look) {
  const MeshView& mesh = compared.mesh;
  const RunTree tree({mesh.points, mesh.vertices * static_cast<std::size_t>(mesh.d)}, mesh.d,
                     kRunReach * size);
  const Runs given(compared.points, mesh.d, kRunReach * size);
  std::vector<Evidence> parts(given.count() + tree.runs().count());
  ParallelFor(parts.size(), [&](std::size_t part) {
    thread_local std::vector<std::uint32_t> around;
    thread_local std::vector<double> step;
    const bool is_given = part < given.count();
    const Runs& runs = is_given ? given : tree.runs();
    const std::size_t run = is_given ? part : part - given.count();
    const std::size_t stride = is_given ? 1 : compared.stride;
    const std::size_t first = (runs.begin(run) + stride - 1) / stride * stride;
    if (first >= runs.end(run)) return;
    around.clear();
    tree.Gather(runs.centre(run), runs.radius(run) + look, &around);
    std::sort(around.begin(), around.end());
    const auto near = [&](const double* y, const auto& visit) {
      WithDimension(mesh.d, [&](auto known) {
        const int d = known() > 0 ? known() : mesh.d;
        for (const std::uint32_t v : around)
          if (const double squared = SquaredDistance(mesh.Point(v), y, d); squared < look * look)
            visit(v, squared);
      });
    };
    for (std::size_t i = first; i < runs.end(run); i += stride) {
      if (is_given)
        compared.AddPoint(comparison, i, step, &parts[part], near);
      else
        compared.AddVertex(comparison, static_cast<std::uint32_t>(i), step, &parts[part], near);
    }
  });
  return parts;
}

}  // namespace

Evidence CompareWithMesh(const MeshView& mesh, const std::vector<double>& points,
                         const std::vector<double>& longest_edge, double size, bool graded,
                         double position_error, std::uint64_t vertices) {
  const Comparison comparison(mesh, longest_edge, size, graded, position_error);
  const Compared compared{mesh, points, std::max<std::uint64_t>(1, mesh.vertices / vertices)};
  const std::vector<Evidence> parts = DoesGridSeparate(mesh)
                                          ? CompareByGrid(comparison, compared, kLook * size)
                                          : CompareByRuns(comparison, compared, size, kLook * size);
  Evidence whole;
  for (const Evidence& part : parts) {
    whole.coarseness = std::max(whole.coarseness, part.coarseness);
    whole.uncovered.insert(whole.uncovered.end(), part.uncovered.begin(), part.uncovered.end());
    if (part.reach >= whole.reach) continue;
    whole.reach = part.reach;
    whole.narrowest = part.narrowest;
    whole.vertex = part.vertex;
    whole.distance = part.distance;
  }
  return whole;
}

}  // namespace stellate::core
