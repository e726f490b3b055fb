#include "core/certificate/claims/proof.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/base/dense.h"
#include "core/base/infinity.h"
#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/base/vector_ops.h"
#include "core/certificate/evidence/ball_grid.h"
#include "core/certificate/measure/corners.h"
#include "core/geometry/reach.h"
#include "core/geometry/simplex.h"

namespace stellate::core {
namespace {

constexpr double kRight = std::numbers::pi / 2;
constexpr double kDegrees = 180 / std::numbers::pi;
// An angle is computed from its squared sine, which is right to some 1e-15: near the right angle,
// where that matters, the angle is right to 3e-8.
constexpr double kAngleMargin = 1e-6;
// The error of lengths computed from dot products, as a share of the lengths.
constexpr double kLengthMargin = 1e-9;
constexpr double kFloatMargin = 1e-6;  // MeshShape keeps floats
// The vertices of a component at which (B) is tried.
constexpr int kTriedVertices = 4;

// The tilt of a simplex for which (A) fails, and by how much.
struct Tilt {
  std::uint32_t simplex = VertexStars::kNone;
  double alpha = 0, rho = 0;
  double sum = 0;  // alpha + theta, radians
};

// The worst simplex of a part, and the largest rho.
struct Extent {
  double rho = 0;
  std::uint64_t failures = 0;
  Tilt worst;

  void Take(const Extent& other) {
    rho = std::max(rho, other.rho);
    failures += other.failures;
    if (other.worst.sum > worst.sum) worst = other.worst;
  }
};

// Condition (A). MeshShape decides most simplices: the sum of the squared sines is no less than the
// largest, and Jung's ball is no smaller than the smallest one.
class AngleCondition {
 public:
  AngleCondition(const MeshView& mesh, const SimplexList& list, const MeshShape& shape,
                 const ReachClaim& claim)
      : mesh_(mesh),
        list_(list),
        shape_(shape),
        claim_(claim),
        jung_(JungRatio(mesh.k) * (1 + kLengthMargin)) {}

  Extent Decide() const {
    std::vector<Extent> parts(ChunkCount(list_.size()));
    ParallelChunks(list_.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      for (std::size_t s = begin; s < end; ++s) Judge(static_cast<std::uint32_t>(s), &parts[chunk]);
    });
    Extent all;
    for (const Extent& part : parts) all.Take(part);
    return all;
  }

 private:
  void Judge(std::uint32_t s, Extent* part) const {
    const double jung = jung_ * shape_.diameters[s] * (1 + kFloatMargin);
    const double tilt = (shape_.tilts[s] + kTiltError) * (1 + kFloatMargin);
    const bool easy =
        tilt < 1 && Holds(std::asin(std::sqrt(tilt)), LargestTurn(jung, claim_.reach));
    if (easy && jung <= part->rho) return;
    Corners corners;
    const SimplexVertices vertices = corners.Of(mesh_, list_[s], mesh_.k);
    const SimplexFrame frame = FrameSimplex(vertices, mesh_.d);
    const double circumradius = MeasureSimplex(vertices, mesh_.d, frame).circumradius;
    const double rho = std::min(jung, circumradius * (1 + kLengthMargin));
    part->rho = std::max(part->rho, rho);
    if (easy) return;
    double alpha = 0;
    for (int i = 0; i <= mesh_.k; ++i)
      alpha = std::max(
          alpha, AngleToTangent(frame, mesh_.k, mesh_.d, mesh_.Tangent(list_[s][i]), mesh_.k));
    const double theta = LargestTurn(rho, claim_.reach);
    if (Holds(alpha, theta)) return;
    ++part->failures;
    if (alpha + theta > part->worst.sum) part->worst = {s, alpha, rho, alpha + theta};
  }

  bool Holds(double alpha, double theta) const {
    return alpha + claim_.tangent_error + theta < kRight - kAngleMargin;
  }

  const MeshView& mesh_;
  const SimplexList& list_;
  const MeshShape& shape_;
  const ReachClaim& claim_;
  const double jung_;
};

// Returns a lower bound of the simplex's distance from p. The point nearest to p in the affine hull
// of some vertices gives a direction in which no vertex is nearer than that bound; the best of all
// faces gives the distance itself.
double DistanceAtLeast(const double* p, SimplexVertices corners, int d) {
  const int n = static_cast<int>(corners.size());
  std::vector<double> offsets(corners.size() * static_cast<std::size_t>(d));
  for (int i = 0; i < n; ++i) {
    double* const offset = offsets.data() + i * d;
    for (int c = 0; c < d; ++c) offset[c] = corners[i][c] - p[c];
  }
  Eigen::Matrix<double, kMaxDimension + 1, kMaxDimension + 1> gram;
  double longest2 = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j)
      gram(i, j) = gram(j, i) = Dot(offsets.data() + i * d, offsets.data() + j * d, d);
    longest2 = std::max(longest2, gram(i, i));
  }
  double best = 0;
  for (unsigned face = 1; face < 1u << n; ++face) {
    std::array<int, kMaxDimension + 1> at{};
    int size = 0;
    for (int i = 0; i < n; ++i)
      if (face >> i & 1u) at[static_cast<std::size_t>(size++)] = i;
    Eigen::MatrixXd g(size, size);
    for (int a = 0; a < size; ++a)
      for (int b = 0; b < size; ++b) g(a, b) = gram(at[a], at[b]);
    const Eigen::VectorXd weights = SolveSymmetric(g, Eigen::VectorXd::Ones(size));
    // Weights of both signs cancel, and are those of no point of the simplex.
    if (!(weights.minCoeff() >= 0)) continue;
    // The direction x = sum of weights times offsets; x . offset i for each vertex.
    double squared = 0, least = kInfinity;
    for (int i = 0; i < n; ++i) {
      double along = 0;
      for (int a = 0; a < size; ++a) along += weights[a] * gram(at[a], i);
      least = std::min(least, along);
    }
    for (int a = 0; a < size; ++a)
      for (int b = 0; b < size; ++b) squared += weights[a] * weights[b] * g(a, b);
    if (squared > 0 && std::isfinite(least)) best = std::max(best, least / std::sqrt(squared));
  }
  return best - kLengthMargin * std::sqrt(longest2);
}

// The vertices of lowest id of each component.
struct Chosen {
  std::vector<std::uint32_t> vertices;
  std::vector<std::uint32_t> components;  // of each
  std::uint32_t component_count = 0;
};

Chosen ChooseVertices(const VertexStars& stars) {
  const SimplexList& list = stars.list();
  std::vector<std::uint32_t> component(list.vertices, VertexStars::kNone);
  std::vector<std::uint32_t> open;
  Chosen chosen;
  std::vector<int> taken;
  std::size_t step = 0;
  for (std::uint32_t v = 0; v < list.vertices; ++v) {
    if (component[v] == VertexStars::kNone) {
      component[v] = chosen.component_count++;
      taken.push_back(0);
      open.push_back(v);
      while (!open.empty()) {
        const std::uint32_t u = open.back();
        open.pop_back();
        for (const std::uint32_t s : stars.Star(u)) {
          CheckInterruption(step++);
          for (int i = 0; i <= list.k; ++i) {
            const std::uint32_t w = list[s][i];
            if (component[w] != VertexStars::kNone) continue;
            component[w] = component[v];
            open.push_back(w);
          }
        }
      }
    }
    if (taken[component[v]]++ >= kTriedVertices) continue;
    chosen.vertices.push_back(v);
    chosen.components.push_back(component[v]);
  }
  return chosen;
}

// Decides condition (B): returns "" or the obstacle.
std::string FindOtherSheet(const MeshView& mesh, const VertexStars& stars, const MeshShape& shape,
                           double most_rho, double reach) {
  const Chosen chosen = ChooseVertices(stars);
  const double near = LargestDistance(most_rho, reach) + shape.max_diameter;
  std::vector<double> centres;
  for (const std::uint32_t v : chosen.vertices)
    centres.insert(centres.end(), mesh.Point(v), mesh.Point(v) + mesh.d);
  const BallGrid grid(mesh.d, centres.data(),
                      std::vector<double>(chosen.vertices.size(), near * (1 + kLengthMargin)));
  struct Sheet {
    std::uint32_t chosen, simplex;
  };
  const double jung = JungRatio(mesh.k) * (1 + kLengthMargin);
  const std::vector<Sheet> sheets =
      ParallelGather<Sheet>(mesh.vertices, [&](std::size_t v, std::vector<Sheet>* found) {
        grid.ForEachAround(mesh.Point(static_cast<std::uint32_t>(v)), [&](std::size_t i, double) {
          const std::uint32_t p = chosen.vertices[i];
          for (const std::uint32_t s : stars.Star(static_cast<std::uint32_t>(v))) {
            const std::uint32_t* ids = stars.list()[s];
            // All vertices of a simplex so near are in the ball: the lowest has it.
            if (ids[0] != v || std::find(ids, ids + mesh.k + 1, p) != ids + mesh.k + 1) continue;
            const double rho = jung * shape.diameters[s] * (1 + kFloatMargin);
            Corners corners;
            if (!(DistanceAtLeast(mesh.Point(p), corners.Of(mesh, ids, mesh.k), mesh.d) >
                  std::min(LargestDistance(rho, reach), LargestDistance(most_rho, reach))))
              found->push_back({static_cast<std::uint32_t>(i), s});
          }
        });
      });
  std::vector<std::uint8_t> blocked(chosen.vertices.size(), 0), shown(chosen.component_count, 0);
  for (const Sheet& sheet : sheets) blocked[sheet.chosen] = 1;
  for (std::size_t i = 0; i < chosen.vertices.size(); ++i)
    if (!blocked[i]) shown[chosen.components[i]] = 1;
  for (const Sheet& sheet : sheets) {
    if (shown[chosen.components[sheet.chosen]]) continue;
    const std::uint32_t p = chosen.vertices[sheet.chosen];
    return Message("simplex ", NameSimplex(stars.list()[sheet.simplex], mesh.k + 1),
                   " is so near vertex ", p,
                   " that the two may lie over one point of the manifold: take a smaller epsilon");
  }
  return {};
}

std::string DescribeTilt(const MeshView& mesh, const SimplexList& list, const Extent& extent,
                         const ReachClaim& claim) {
  const Tilt& worst = extent.worst;
  std::string text =
      Message("simplex ", NameSimplex(list[worst.simplex], mesh.k + 1), " is tilted by ",
              Brief(worst.alpha * kDegrees), " degrees from a tangent space");
  const double turn = kRight - claim.tangent_error - worst.alpha;
  if (!(worst.rho < claim.reach))
    return text + Message(" and its enclosing ball may have the radius ", Brief(worst.rho),
                          ", which is not below the declared reach: take epsilon at most ",
                          Brief(RadiusThatTurns(kRight / 2, claim.reach)));
  text += Message(", and the manifold may turn by ",
                  Brief(LargestTurn(worst.rho, claim.reach) * kDegrees),
                  " degrees under it, together no less than the right angle");
  if (extent.failures > 1) text += Message("; simplices like it: ", extent.failures);
  if (turn > 0)
    return text + Message("; a radius of ", Brief(RadiusThatTurns(turn, claim.reach)),
                          " would do for it, of ", Brief(worst.rho), " now");
  return text + "; it is too thin to be of use: take a smaller epsilon, or a larger sliver_bound";
}

}  // namespace

double Blame(const ReachClaim& claim, double length, double noise) {
  // Positions that are wrong by `noise` change `away` by twice that, and the length by as much.
  return (2 + 2 * length / claim.reach) * noise + std::sin(claim.tangent_error) * length;
}

bool Contradicts(const ReachClaim& claim, double length, double away, double noise) {
  const double allowed = length * length / (2 * claim.reach);
  return away * (1 - kLengthMargin) > allowed * (1 + kLengthMargin) + Blame(claim, length, noise);
}

Proof ProveFromReach(const MeshView& mesh, const VertexStars& stars, const MeshShape& shape,
                     const ReachClaim& claim) {
  Proof proof;
  const SimplexList& list = stars.list();
  const Extent extent = AngleCondition(mesh, list, shape, claim).Decide();
  proof.distance = LargestDistance(extent.rho, claim.reach);
  if (extent.failures > 0) {
    proof.obstacle = DescribeTilt(mesh, list, extent, claim);
    return proof;
  }
  proof.obstacle = FindOtherSheet(mesh, stars, shape, extent.rho, claim.reach);
  proof.holds = proof.obstacle.empty();
  return proof;
}

}  // namespace stellate::core
