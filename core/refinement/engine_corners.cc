// The engine's work at corners of a manifold with boundary: how M looks where more than K walls
// meet, and where the first points of edges are.

#include <Eigen/Core>
#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "core/base/dense.h"
#include "core/base/parallel.h"
#include "core/boundary/corner_cone.h"
#include "core/refinement/engine.h"

namespace stellate::core {
namespace {

// The radius of a corner's concentric shell: this share of epsilon and, so that two shells keep
// apart, of the distance to the nearest other corner.
constexpr double kShell = 0.5;
constexpr double kShellShare = 0.4;

template <int K>
using Vector = Eigen::Matrix<double, K, 1>;

// Returns the directions of the edges that leave a corner, and their walls. With K walls, each edge
// is on all walls except one, and leaves that one inwards.
template <int K>
std::vector<std::pair<Vector<K>, WallSet>> EdgesAtCorner(const Stars<K>& stars, std::uint32_t p) {
  std::vector<std::pair<Vector<K>, WallSet>> edges;
  const WallSet walls = stars.sample().walls(p);
  if (CountWalls(walls) > K) {
    for (const auto& ray : ConeOf<K>(walls, stars.sample().Conormals(p)).rays)
      edges.emplace_back(ray.along, ray.walls);
    return edges;
  }
  const Eigen::Map<const Eigen::Matrix<double, K, K, Eigen::RowMajor>> conormals(
      stars.sample().Conormals(p));
  const Eigen::Matrix<double, K, K> along = -Inverse<K>(conormals);
  int number = 0;
  ForEachWall(walls, [&](int wall) {
    edges.emplace_back(along.col(number++).normalized(), walls & ~SetOfWall(wall));
  });
  return edges;
}

}  // namespace

// Plans, before all other points, one point on each edge of each corner. All are equally far from
// the corner, so that two edges at a sharp angle do not split each other without end.
template <int K>
PlannedPoints Engine<K>::PlanShells() {
  std::vector<std::uint32_t> corners;
  for (std::uint32_t p = 0; p < stars_.size(); ++p)
    if (CountWalls(stars_.sample().walls(p)) >= K) corners.push_back(p);
  PlannedPoints planned;
  std::vector<Eigen::VectorXd> points;
  for (const std::uint32_t p : corners) {
    CheckInterruption(points.size());
    double radius = kShell * criteria_.epsilon;
    for (const std::uint32_t q : corners)
      if (q != p)
        radius =
            std::min(radius, kShellShare * Distance(stars_.sample().Point(p),
                                                    stars_.sample().Point(q), stars_.sample().d()));
    boundary_.SetShell(p, radius);
    for (const auto& [along, walls] : EdgesAtCorner<K>(stars_, p)) {
      const Vector<K> x = radius * along;
      stars_.sample().Lift(p, x.data(), points.emplace_back(stars_.sample().d()).data());
      planned.walls.push_back(walls);
    }
  }
  planned.points.resize(stars_.sample().d(), static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i)
    planned.points.col(static_cast<Eigen::Index>(i)) = points[i];
  return planned;
}

// Each wall by itself: a corner on some of them need not be where these alone are independent.
template <int K>
PlannedPoints Engine<K>::CrowdQuestions() const {
  PlannedPoints planned;
  for (const auto& crowd : boundary_.crowds())
    ForEachWall(crowd.possible, [&](int wall) { planned.walls.push_back(SetOfWall(wall)); });
  planned.points.resize(stars_.sample().d(), static_cast<Eigen::Index>(planned.walls.size()));
  Eigen::Index column = 0;
  for (const auto& crowd : boundary_.crowds())
    for (int i = 0; i < CountWalls(crowd.possible); ++i) planned.points.col(column++) = crowd.point;
  return planned;
}

template <int K>
std::optional<CrowdedCorner> Engine<K>::SettleCrowds(const AnsweredPoints& answers) {
  std::optional<CrowdedCorner> bad;
  const double same = BoundaryState<K>::kSameCorner * criteria_.epsilon;
  Eigen::Index column = 0;
  for (const auto& crowd : boundary_.TakeCrowds()) {
    const auto dk = Eigen::Index{stars_.sample().d()};
    const Eigen::Map<const Eigen::MatrixXd> tangents(crowd.tangent.data(), dk, K);
    std::map<int, Vector<K>> conormals;
    int number = 0;
    ForEachWall(crowd.walls, [&](int wall) {
      conormals[wall] = crowd.conormals.template segment<K>(K * Eigen::Index{number++});
    });
    WallSet walls = crowd.walls;
    ForEachWall(crowd.possible, [&](int wall) {
      const Eigen::Index c = column++;
      if (!answers.found[static_cast<std::size_t>(c)] ||
          (answers.points.col(c) - crowd.point).norm() > same)
        return;
      const Eigen::Map<const Eigen::MatrixXd> own(answers.tangents.col(c).data(), dk, K);
      const Eigen::VectorXd outward = own * answers.conormals.col(c).template head<K>();
      conormals[wall] = (tangents.transpose() * outward).normalized();
      walls |= SetOfWall(wall);
    });
    if (!IsSubset(crowd.beyond, walls) || is_full() ||
        stars_.sample().AnyWithin(crowd.point.data(), same) ||
        stars_.sample().InProtectingBall(crowd.point.data()))
      continue;
    std::vector<double> all;
    const auto gather = [&](WallSet of) {
      all.clear();
      ForEachWall(of, [&](int wall) {
        all.insert(all.end(), conormals[wall].data(), conormals[wall].data() + K);
      });
    };
    gather(walls);
    if (CountWalls(walls) > kMostAtCorner) {
      bad = CrowdedCorner{crowd.point, walls, 0};
      continue;
    }
    const CornerCone<K> cone = ConeOf<K>(walls, all.data());
    if (cone.rays.empty()) continue;  // M has no more than that point there
    if (!cone.is_simple) {
      bad = CrowdedCorner{crowd.point, walls, cone.crowded};
      continue;
    }
    gather(cone.walls);
    stars_.Add(crowd.point.data(), crowd.tangent.data(), Stars<K>::kNone, cone.walls, all.data());
    if (answers.sizes.size() > 0) sizes_.AppendGiven(crowd.size);
  }
  return bad;
}

#define STELLATE_EACH(K)                                    \
  template PlannedPoints Engine<K>::PlanShells();           \
  template PlannedPoints Engine<K>::CrowdQuestions() const; \
  template std::optional<CrowdedCorner> Engine<K>::SettleCrowds(const AnsweredPoints&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
