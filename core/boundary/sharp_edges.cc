#include "core/boundary/sharp_edges.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"
#include "core/base/vector_ops.h"
#include "core/complex/corner_sectors.h"
#include "core/geometry/corner_cone.h"

namespace stellate::core {

namespace {

// Returns the cosine of the smallest angle between two walls of an arrangement at p, `first` and
// `second`, over all sectors between live parts of them, also those outside of M: points of the two
// walls cut each other there, too.
template <int K>
double CosineBetween(const Sample<K>& sample, std::uint32_t p, int first, int second,
                     double inside) {
  if (sample.sectors().labels().empty()) return inside;
  const WallSet walls = sample.walls(p);
  const WallSet pair = SetOfWall(first) | SetOfWall(second), rest = walls & ~pair;
  double sharpest = -1;
  for (WallSet part = rest;; part = (part - 1) & rest) {
    for (const WallSet sides : {WallSet{0}, SetOfWall(first), SetOfWall(second), pair}) {
      const WallSet signs = (sample.sectors().Signs(p) & ~walls) | part | sides;
      // On equal sides of the two the angle is that of the half-spaces.
      const double cosine = sides == 0 || sides == pair ? inside : -inside;
      if (cosine > sharpest && sample.sectors().labels().Piece(SetOfWall(first), signs) != 0 &&
          sample.sectors().labels().Piece(SetOfWall(second), signs) != 0)
        sharpest = cosine;
    }
    if (part == 0) return sharpest;
  }
}

// A half of a wall that meets others in a face of codimension 2, seen across that: its wall, and
// the direction in which it leaves the face, in the plane of two orthonormal axes.
struct HalfWall {
  int wall;
  double along[2];
};

// Returns the live half-walls that meet in a face of codimension 2 at p. `signs`: of the other
// walls.
template <int K>
std::vector<HalfWall> HalfWallsAround(const Sample<K>& sample, std::uint32_t p, WallSet face,
                                      WallSet signs) {
  const WallSet walls = sample.walls(p);
  const auto conormal = [&](int wall) {
    return sample.Conormals(p) + K * CountWalls(walls & (SetOfWall(wall) - 1));
  };
  // Two axes, the first along the first conormal, the second along what is off it of the steepest.
  const double* const first = conormal(std::countr_zero(face));
  double second[K] = {}, most2 = 0;
  ForEachWall(face, [&](int wall) {
    double off[K];
    const double along = Dot(first, conormal(wall), K);
    for (int a = 0; a < K; ++a) off[a] = conormal(wall)[a] - along * first[a];
    if (const double norm2 = Dot(off, off, K); norm2 > most2) {
      most2 = norm2;
      for (int a = 0; a < K; ++a) second[a] = off[a] / std::sqrt(norm2);
    }
  });
  const auto in_plane = [&](int wall, double* x) {
    x[0] = Dot(first, conormal(wall), K);
    x[1] = Dot(second, conormal(wall), K);
    const double length = std::sqrt(x[0] * x[0] + x[1] * x[1]);
    x[0] /= length;
    x[1] /= length;
  };
  std::vector<HalfWall> live;
  ForEachWall(face, [&](int wall) {
    double normal[2];
    in_plane(wall, normal);
    for (const double sign : {1.0, -1.0}) {
      const HalfWall half{wall, {-sign * normal[1], sign * normal[0]}};
      WallSet there = signs & ~face;
      ForEachWall(face, [&](int other) {
        double outward[2];
        in_plane(other, outward);
        if (outward[0] * half.along[0] + outward[1] * half.along[1] < 0) there |= SetOfWall(other);
      });
      if (sample.sectors().labels().Piece(SetOfWall(wall), there) != 0) live.push_back(half);
    }
  });
  return live;
}

// SharpestAt for a point of an arrangement where more walls meet than its face has dimensions less
// than M: of all live half-walls around an edge, the two at the smallest angle.
template <int K>
std::optional<WallCosine> SharpestOfHalfWalls(const Sample<K>& sample, std::uint32_t p) {
  const LabelTable& labels = sample.sectors().labels();
  std::optional<WallCosine> sharpest;
  std::set<std::pair<WallSet, WallSet>> seen;
  const auto look = [&](WallSet face, WallSet signs) {
    face = labels.Close(face);
    signs &= ~face;
    if (!seen.emplace(face, signs).second || labels.Piece(face, signs) == 0) return;
    const std::vector<HalfWall> live = HalfWallsAround<K>(sample, p, face, signs);
    for (std::size_t i = 0; i < live.size(); ++i)
      for (std::size_t j = 0; j < i; ++j) {
        const double cosine =
            live[i].along[0] * live[j].along[0] + live[i].along[1] * live[j].along[1];
        if (live[i].wall != live[j].wall && (!sharpest || cosine > sharpest->cosine))
          sharpest = WallCosine{SetOfWall(live[i].wall) | SetOfWall(live[j].wall), cosine};
      }
  };
  const int codimension = labels.Codimension(sample.walls(p));
  if (codimension == 2 || K == 2) {
    look(sample.walls(p), sample.sectors().Signs(p));
    return sharpest;
  }
  const bool is_corner = codimension >= K;
  for (int sector = 0; sector < sample.sectors().Count(p); ++sector) {
    const Site site = sample.At(p, sector);
    const WallSet signs = sample.sectors().SignsOf(p, sector);
    // At a corner not every two walls of a sector share an edge of it.
    const CornerCone<K> cone =
        is_corner ? ConeOfSector<K>(site.walls, site.conormals, sample.sectors().At(p, sector))
                  : CornerCone<K>();
    ForEachWall(site.bounds, [&](int first) {
      ForEachWall(site.bounds & ~((SetOfWall(first) << 1) - 1), [&](int second) {
        const WallSet pair = SetOfWall(first) | SetOfWall(second);
        const bool share =
            !is_corner || std::any_of(cone.rays.begin(), cone.rays.end(),
                                      [&](const auto& ray) { return IsSubset(pair, ray.walls); });
        if (share) look(pair, signs);
      });
    });
  }
  return sharpest;
}

}  // namespace

template <int K>
std::optional<WallCosine> SharpestAt(const Stars<K>& stars, std::uint32_t p) {
  const WallSet walls = stars.sample().walls(p);
  if (CountWalls(walls) < 2) return std::nullopt;
  if (!stars.sample().sectors().labels().empty() &&
      CountWalls(walls) > std::min(K, stars.sample().Codimension(walls)))
    return SharpestOfHalfWalls<K>(stars.sample(), p);
  std::optional<WallCosine> sharpest;
  const double* const conormals = stars.sample().Conormals(p);
  // If there are more than K walls, some meet only in the corner, and in no edge.
  const CornerCone<K> cone = CountWalls(walls) > K ? ConeOf<K>(walls, conormals) : CornerCone<K>();
  const auto share_edge = [&](WallSet pair) {
    return cone.rays.empty() || std::any_of(cone.rays.begin(), cone.rays.end(),
                                            [&](const auto& r) { return IsSubset(pair, r.walls); });
  };
  int a = 0;
  ForEachWall(walls, [&](int first) {
    int b = a + 1;
    ForEachWall(walls & ~((SetOfWall(first) << 1) - 1), [&](int second) {
      // The angle between the half-spaces that the walls leave: 0 if their conormals are opposite.
      const double cosine = CosineBetween<K>(stars.sample(), p, first, second,
                                             -Dot(conormals + K * a, conormals + K * b, K));
      if ((!sharpest || cosine > sharpest->cosine) &&
          share_edge(SetOfWall(first) | SetOfWall(second)))
        sharpest = WallCosine{SetOfWall(first) | SetOfWall(second), cosine};
      ++b;
    });
    ++a;
  });
  return sharpest;
}

template <int K>
std::optional<WallAngle> Sharpest(const Stars<K>& stars) {
  std::optional<WallCosine> sharpest;
  std::uint32_t at = 0;
  for (const std::uint32_t p : stars.sample().boundary()) {
    CheckInterruption(p);
    const std::optional<WallCosine> here = SharpestAt<K>(stars, p);
    if (!here || (sharpest && sharpest->cosine >= here->cosine)) continue;
    sharpest = here;
    at = p;
  }
  if (!sharpest) return std::nullopt;
  const double degrees =
      std::acos(std::clamp(sharpest->cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
  return WallAngle{sharpest->walls, degrees,
                   Eigen::Map<const Eigen::VectorXd>(stars.sample().Point(at), stars.sample().d())};
}

#define STELLATE_EACH(K)                                                            \
  template std::optional<WallCosine> SharpestAt<K>(const Stars<K>&, std::uint32_t); \
  template std::optional<WallAngle> Sharpest<K>(const Stars<K>&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
