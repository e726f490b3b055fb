#include "core/refinement/corners.h"

#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <utility>
#include <vector>

#include "core/base/dense.h"
#include "core/base/interruption.h"
#include "core/base/vector_ops.h"
#include "core/complex/corner_sectors.h"
#include "core/geometry/corner_cone.h"

namespace stellate::core {
namespace {

// The radius of a corner's concentric shell: this share of epsilon and, so that two shells keep
// apart, of the distance to the nearest other corner.
constexpr double kShell = 0.5;
constexpr double kShellShare = 0.4;

// Of an arrangement, in epsilon: a wall this near passes through a corner, and one up to the second
// distance from it may be meant to. In the largest coordinate: what rounding does to either.
constexpr double kThrough = 1e-9;
constexpr double kBeside = 1e-3;
constexpr double kRounding = 1e-13;

template <int K>
using Vector = Eigen::Matrix<double, K, 1>;

template <int K>
using Edge = std::pair<Vector<K>, WallSet>;

// Returns the live edges that leave a corner of an arrangement, one after the other along the
// sectors that they bound.
template <int K>
std::vector<Edge<K>> EdgesOfSectors(const Stars<K>& stars, std::uint32_t p) {
  const Sectors& sectors = stars.sample().sectors();
  const LabelTable& labels = sectors.labels();
  std::vector<Edge<K>> edges;
  for (int sector = 0; sector < sectors.Count(p); ++sector)
    for (const auto& ray : ConeOfSector<K>(stars.sample().walls(p), stars.sample().Conormals(p),
                                           sectors.At(p, sector))
                               .rays) {
      const WallSet walls = labels.Close(ray.walls);
      const bool is_known = std::any_of(edges.begin(), edges.end(), [&](const Edge<K>& edge) {
        return edge.second == walls && edge.first.dot(ray.along) > 0;
      });
      if (!is_known && labels.Piece(walls, sectors.SignsOf(p, sector)) != 0)
        edges.emplace_back(ray.along, walls);
    }
  return edges;
}

// Returns the directions of the edges that leave a corner, and their walls. With K walls, each edge
// is on all walls except one, and leaves that one inwards.
template <int K>
std::vector<Edge<K>> EdgesAtCorner(const Stars<K>& stars, std::uint32_t p) {
  std::vector<Edge<K>> edges;
  const WallSet walls = stars.sample().walls(p);
  if (CountWalls(walls) > K && !stars.sample().sectors().labels().empty())
    return EdgesOfSectors<K>(stars, p);
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

// Returns the walls across which the label differs between signs that occur around a corner.
WallSet ActiveAround(const LabelTable& labels, WallSet walls, const std::vector<WallSet>& signs) {
  WallSet active = 0;
  for (const WallSet s : signs)
    ForEachWall(walls, [&](int wall) {
      const WallSet beyond = s ^ SetOfWall(wall);
      if (std::binary_search(signs.begin(), signs.end(), beyond, std::greater<>()) &&
          labels.Of(s) != labels.Of(beyond))
        active |= SetOfWall(wall);
    });
  return labels.Close(active);
}

// Returns the walls with one tangent space at a corner, which are crossed together and none of them
// alone, if the label differs across them.
WallSet CrossedTogether(const LabelTable& labels, WallSet walls,
                        const std::vector<WallSet>& signs) {
  WallSet alone = 0, some = 0, all = ~WallSet{0};
  for (const WallSet s : signs) {
    some |= s;
    all &= s;
    ForEachWall(walls, [&](int wall) {
      if (std::binary_search(signs.begin(), signs.end(), s ^ SetOfWall(wall), std::greater<>()))
        alone |= SetOfWall(wall);
    });
  }
  const WallSet together = walls & some & ~all & ~alone;
  for (const WallSet s : signs)
    for (const WallSet t : signs)
      if (IsSubset(s ^ t, together) && labels.Of(s) != labels.Of(t)) return together;
  return 0;
}

}  // namespace

template <int K>
PlannedPoints Corners<K>::PlanShells() {
  std::vector<std::uint32_t> corners;
  for (const std::uint32_t p : engine_.stars.sample().boundary())
    if (engine_.stars.sample().Codimension(engine_.stars.sample().walls(p)) >= K)
      corners.push_back(p);
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

// Of an arrangement, which sectors there are hangs on whether a wall passes through the corner:
// what is farther away than the first distance and nearer than the second leaves that open.
template <int K>
typename Corners<K>::Known Corners<K>::KnownOf(const Crowd& crowd, const AnsweredPoints& answers,
                                               Eigen::Index first) const {
  const bool has_labels = !engine_.stars.sample().sectors().labels().empty();
  const double epsilon = engine_.criteria.epsilon;
  const double same =
      has_labels ? kThrough * epsilon + kRounding * crowd.point.template lpNorm<Eigen::Infinity>()
                 : BoundaryState<K>::kSameCorner * epsilon;
  const auto dk = Eigen::Index{engine_.stars.sample().d()};
  const Eigen::Map<const Eigen::MatrixXd> tangents(crowd.tangent.data(), dk, K);
  Known known{crowd, crowd.walls, 0, {}};
  Eigen::Index number = 0;
  ForEachWall(crowd.walls, [&](int wall) {
    known.conormals[wall] = crowd.conormals.template segment<K>(K * number++);
  });
  ForEachWall(crowd.possible, [&](int wall) {
    const Eigen::Index c = first++;
    if (!answers.found[static_cast<std::size_t>(c)]) return;
    const double away = (answers.points.col(c) - crowd.point).norm();
    if (away > (has_labels ? kBeside * epsilon : same)) return;
    const Eigen::Map<const Eigen::MatrixXd> own(answers.tangents.col(c).data(), dk, K);
    const Eigen::VectorXd outward = own * answers.conormals.col(c).template head<K>();
    known.conormals[wall] = (tangents.transpose() * outward).normalized();
    (away > same ? known.beside : known.at) |= SetOfWall(wall);
  });
  return known;
}

template <int K>
void Corners<K>::Insert(const Known& known, WallSet walls, WallSet signs) {
  const std::vector<double> conormals = known.ConormalsOf(walls);
  engine_.stars.Add(known.crowd.point.data(), known.crowd.tangent.data(), Stars<K>::kNone, walls,
                    conormals.data(), signs);
  if (engine_.criteria.sizes_given) engine_.sizes.AppendGiven(known.crowd.size);
}

template <int K>
std::optional<CrowdedCorner> Corners<K>::SettleCone(const Known& known) {
  const WallSet walls = known.at;
  if (!IsSubset(known.crowd.beyond, walls)) return std::nullopt;
  if (CountWalls(walls) > kMostAtCorner) return CrowdedCorner{known.crowd.point, walls};
  const CornerCone<K> cone = ConeOf<K>(walls, known.ConormalsOf(walls).data());
  if (cone.rays.empty()) {  // M has no more than that point there
    engine_.boundary.NoteLonePoint(known.crowd.point);
    engine_.boundary.NoteTouch(known.crowd.point, walls);
    return std::nullopt;
  }
  engine_.boundary.NoteTouch(known.crowd.point, walls & ~cone.walls);
  if (!cone.is_simple) return CrowdedCorner{known.crowd.point, walls, cone.crowded};
  Insert(known, cone.walls, 0);
  return std::nullopt;
}

template <int K>
std::optional<CrowdedCorner> Corners<K>::SettleSectors(const Known& known) {
  const LabelTable& labels = engine_.stars.sample().sectors().labels();
  const Crowd& crowd = known.crowd;
  const auto around = [&](WallSet walls) {
    return SignsAround<K>(walls, known.ConormalsOf(walls).data(), crowd.signs);
  };
  if (known.beside != 0) {
    const WallSet all = known.at | known.beside;
    if ((ActiveAround(labels, all, around(all)) & known.beside) != 0)
      return CrowdedCorner{crowd.point, all, 0, known.beside};
  }
  if (known.at == crowd.walls) {
    if (labels.Active(crowd.walls, crowd.signs) == crowd.walls)
      Insert(known, crowd.walls, crowd.signs);
    return std::nullopt;  // or a corner of fewer walls, where others pass by
  }
  const std::vector<WallSet> signs = around(known.at);
  if (std::any_of(signs.begin(), signs.end(),
                  [&](WallSet s) { return labels.Of(s) == LabelTable::kImpossible; }))
    return CrowdedCorner{crowd.point, known.at, 0, 0, true};
  if (const WallSet together = CrossedTogether(labels, known.at, signs); together != 0)
    return CrowdedCorner{crowd.point, known.at, together};
  const WallSet active = ActiveAround(labels, known.at, signs);
  engine_.boundary.NoteTouch(crowd.point, known.at & ~active);
  if (labels.Codimension(active) < K) return std::nullopt;
  // Walls that only touch M there, each sector on one side of them, and all on the same.
  WallSet inside = ~WallSet{0}, outside = ~WallSet{0};
  for (const WallSet s : signs) {
    if (labels.Of(s) == 0) continue;
    inside &= s;
    outside &= ~s;
  }
  if (labels.Codimension(active) == K && IsSubset(known.at & ~active, inside | outside)) {
    Insert(known, active, (crowd.signs & ~known.at) | (inside & known.at));
    return std::nullopt;
  }
  for (const WallSet s : signs) {
    const std::vector<double> conormals = known.ConormalsOf(known.at);
    for (const auto& ray : ConeOfSector<K>(known.at, conormals.data(), {s, known.at}).rays)
      if (labels.Codimension(labels.Active(ray.walls, s)) > K - 1)
        return CrowdedCorner{crowd.point, known.at, ray.walls};
  }
  Insert(known, known.at, crowd.signs);
  return std::nullopt;
}

template <int K>
std::optional<CrowdedCorner> Corners<K>::Settle(const AnsweredPoints& answers) {
  std::optional<CrowdedCorner> bad;
  const Sample<K>& sample = engine_.stars.sample();
  const double same = BoundaryState<K>::kSameCorner * engine_.criteria.epsilon;
  Eigen::Index first = 0;
  for (const Crowd& crowd : engine_.boundary.TakeCrowds()) {
    const Known known = KnownOf(crowd, answers, first);
    first += CountWalls(crowd.possible);
    if (engine_.is_full() || sample.AnyWithin(crowd.point.data(), same) ||
        sample.InProtectingBall(crowd.point.data()))
      continue;
    const auto found = sample.sectors().labels().empty() ? SettleCone(known) : SettleSectors(known);
    if (found) bad = found;
  }
  return bad;
}

STELLATE_INSTANTIATE_CLASS(Corners)

}  // namespace stellate::core
