#include "core/boundary/sharp_edges.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"
#include "core/base/vector_ops.h"
#include "core/boundary/corner_cone.h"

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

}  // namespace

template <int K>
std::optional<WallCosine> SharpestAt(const Stars<K>& stars, std::uint32_t p) {
  const WallSet walls = stars.sample().walls(p);
  if (CountWalls(walls) < 2) return std::nullopt;
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
