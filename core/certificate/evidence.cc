#include "core/certificate/evidence.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/parallel.h"
#include "core/base/vector_ops.h"
#include "core/certificate/vertex_grid.h"
#include "core/geometry/reach_bound.h"

namespace stellate::core {
namespace {

// Two sheets this number of sizes apart are no more than the reach that a mesh of this size must
// have.
constexpr double kLook = 2.5;
constexpr std::uint64_t kPointsInPart = 1 << 8;

class Holder {
 public:
  Holder(const MeshView& mesh, const std::vector<double>& longest_edge, double size, bool graded,
         double position_error)
      : mesh_(mesh),
        longest_edge_(longest_edge),
        size_(size),
        graded_(graded),
        position_error_(position_error),
        grid_(mesh, kLook * size) {}

  double SizeAt(std::uint32_t v) const {
    return graded_ ? std::min(size_, longest_edge_[v] * std::numbers::inv_sqrt3) : size_;
  }

  // `index`: that y goes by in the evidence; `self`: the vertex that y is, if it is one.
  void Hold(const double* y, std::uint64_t index, std::uint32_t self, std::vector<double>& step,
            Evidence* evidence) const {
    const int d = mesh_.d;
    step.resize(static_cast<std::size_t>(d));
    double nearest = INFINITY, nearest_size = size_;
    grid_.ForEachAround(y, [&](std::uint32_t v, double squared) {
      if (v == self) return;
      const double size = SizeAt(v);
      if (squared < nearest) {
        nearest = squared;
        nearest_size = graded_ ? std::min(size_, longest_edge_[v]) : size_;
      }
      if (squared > kLook * kLook * size * size) return;
      const double* p = mesh_.Point(v);
      for (int i = 0; i < d; ++i) step[static_cast<std::size_t>(i)] = y[i] - p[i];
      double along2 = 0;
      for (int a = 0; a < mesh_.k; ++a) {
        const double along = Dot(mesh_.Tangent(v) + a * d, step.data(), d);
        along2 += along * along;
      }
      const double away2 = squared - along2, bound = 2 * kLook * size;
      // |y - p|^2 / (2 away) above all that matters, as nearly always.
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
    if (self == kNobody &&
        !(nearest <= kCoverageShare * kCoverageShare * nearest_size * nearest_size))
      evidence->uncovered.push_back(index);
  }

  static constexpr std::uint32_t kNobody = 0xffffffffu;

 private:
  const MeshView& mesh_;
  const std::vector<double>& longest_edge_;
  const double size_;
  const bool graded_;
  const double position_error_;
  const VertexGrid grid_;
};

}  // namespace

Evidence HoldAgainst(const MeshView& mesh, const std::vector<double>& points,
                     const std::vector<double>& longest_edge, double size, bool graded,
                     double position_error, std::uint64_t vertices) {
  const Holder holder(mesh, longest_edge, size, graded, position_error);
  const std::uint64_t given = points.size() / static_cast<std::size_t>(mesh.d);
  const std::uint64_t stride = std::max<std::uint64_t>(1, mesh.vertices / vertices);
  const std::uint64_t all = given + (mesh.vertices + stride - 1) / stride;
  std::vector<Evidence> parts((all + kPointsInPart - 1) / kPointsInPart);
  ParallelFor(parts.size(), [&](std::uint64_t part) {
    std::vector<double> step;
    for (std::uint64_t i = part * kPointsInPart; i < std::min(all, (part + 1) * kPointsInPart);
         ++i) {
      if (i < given) {
        holder.Hold(points.data() + i * static_cast<std::size_t>(mesh.d), i, Holder::kNobody, step,
                    &parts[part]);
        continue;
      }
      const auto v = static_cast<std::uint32_t>((i - given) * stride);
      holder.Hold(mesh.Point(v), Evidence::kNone, v, step, &parts[part]);
    }
  });
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
