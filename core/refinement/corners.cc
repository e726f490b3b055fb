#include "core/refinement/corners.h"

#include <Eigen/Core>
#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "core/base/dense.h"
#include "core/base/interruption.h"
#include "core/base/vector_ops.h"
#include "core/boundary/corner_cone.h"

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
    const Vector<K> inward = along.col(number++).normalized();
    const WallSet others = walls & ~SetOfWall(wall);
    const WallSet signs = stars.sample().sectors().Signs(p) & ~SetOfWall(wall);
    const LabelTable& labels = stars.sample().sectors().labels();
    if (labels.empty() || labels.Piece(others, signs | SetOfWall(wall)) != 0)
      edges.emplace_back(inward, others);
    if (!labels.empty() && labels.Piece(others, signs) != 0) edges.emplace_back(-inward, others);
  });
  return edges;
}

}  // namespace

template <int K>
PlannedPoints Corners<K>::PlanShells() {
  std::vector<std::uint32_t> corners;
  for (const std::uint32_t p : engine_.stars.sample().boundary())
    if (CountWalls(engine_.stars.sample().walls(p)) >= K) corners.push_back(p);
  PlannedPoints planned;
  std::vector<Eigen::VectorXd> points;
  for (const std::uint32_t p : corners) {
    CheckInterruption(points.size());
    double radius = kShell * engine_.criteria.epsilon;
    for (const std::uint32_t q : corners)
      if (q != p)
        radius = std::min(radius, kShellShare * Distance(engine_.stars.sample().Point(p),
                                                         engine_.stars.sample().Point(q),
                                                         engine_.stars.sample().d()));
    engine_.boundary.SetShell(p, radius);
    for (const auto& [along, walls] : EdgesAtCorner<K>(engine_.stars, p)) {
      const Vector<K> x = radius * along;
      engine_.stars.sample().Lift(p, x.data(),
                                  points.emplace_back(engine_.stars.sample().d()).data());
      planned.walls.push_back(walls);
    }
  }
  planned.points.resize(engine_.stars.sample().d(), static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i)
    planned.points.col(static_cast<Eigen::Index>(i)) = points[i];
  return planned;
}

// Each wall by itself: a corner on some of them need not be where these alone are independent.
template <int K>
PlannedPoints Corners<K>::Questions() const {
  PlannedPoints planned;
  for (const auto& crowd : engine_.boundary.crowds())
    ForEachWall(crowd.possible, [&](int wall) { planned.walls.push_back(SetOfWall(wall)); });
  planned.points.resize(engine_.stars.sample().d(),
                        static_cast<Eigen::Index>(planned.walls.size()));
  Eigen::Index column = 0;
  for (const auto& crowd : engine_.boundary.crowds())
    for (int i = 0; i < CountWalls(crowd.possible); ++i) planned.points.col(column++) = crowd.point;
  return planned;
}

template <int K>
std::optional<CrowdedCorner> Corners<K>::Settle(const AnsweredPoints& answers) {
  std::optional<CrowdedCorner> bad;
  const double same = BoundaryState<K>::kSameCorner * engine_.criteria.epsilon;
  const LabelTable& labels = engine_.stars.sample().sectors().labels();
  Eigen::Index column = 0;
  for (const auto& crowd : engine_.boundary.TakeCrowds()) {
    const auto dk = Eigen::Index{engine_.stars.sample().d()};
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
    if ((labels.empty() && !IsSubset(crowd.beyond, walls)) || engine_.is_full() ||
        engine_.stars.sample().AnyWithin(crowd.point.data(), same) ||
        engine_.stars.sample().InProtectingBall(crowd.point.data()))
      continue;
    std::vector<double> all;
    const auto gather = [&](WallSet of) {
      all.clear();
      ForEachWall(of, [&](int wall) {
        all.insert(all.end(), conormals[wall].data(), conormals[wall].data() + K);
      });
    };
    if (!labels.empty()) {
      const WallSet active = labels.Active(walls, crowd.signs);
      if (CountWalls(active) > K) bad = CrowdedCorner{crowd.point, active, 0};
      if (active != crowd.walls) continue;  // or a corner of fewer walls, where others pass by
      gather(active);
      engine_.stars.Add(crowd.point.data(), crowd.tangent.data(), Stars<K>::kNone, active,
                        all.data(), crowd.signs);
      if (answers.sizes.size() > 0) engine_.sizes.AppendGiven(crowd.size);
      continue;
    }
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
    engine_.stars.Add(crowd.point.data(), crowd.tangent.data(), Stars<K>::kNone, cone.walls,
                      all.data());
    if (answers.sizes.size() > 0) engine_.sizes.AppendGiven(crowd.size);
  }
  return bad;
}

STELLATE_INSTANTIATE_CLASS(Corners)

}  // namespace stellate::core
