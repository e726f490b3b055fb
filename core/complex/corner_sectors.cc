#include "core/complex/corner_sectors.h"

#include <algorithm>
#include <functional>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

// Returns K independent walls of a corner, one after the other the steepest off those before.
template <int K>
WallSet BasisOf(WallSet walls, const double* conormals) {
  std::vector<int> number;
  ForEachWall(walls, [&](int wall) { number.push_back(wall); });
  std::vector<double> off(conormals, conormals + K * number.size());
  WallSet basis = 0;
  for (int taken = 0; taken < K; ++taken) {
    std::size_t best = 0;
    double most2 = 0;
    for (std::size_t i = 0; i < number.size(); ++i) {
      const double norm2 = Dot(off.data() + K * i, off.data() + K * i, K);
      if (norm2 <= most2 || IsSubset(SetOfWall(number[i]), basis)) continue;
      most2 = norm2;
      best = i;
    }
    basis |= SetOfWall(number[best]);
    double axis[K];
    for (int a = 0; a < K; ++a) axis[a] = off[K * best + static_cast<std::size_t>(a)];
    for (std::size_t i = 0; i < number.size() && most2 > 0; ++i) {
      double* const other = off.data() + K * i;
      const double share = Dot(axis, other, K) / most2;
      for (int a = 0; a < K; ++a) other[a] -= share * axis[a];
    }
  }
  return basis;
}

bool Contains(const std::vector<WallSet>& descending, WallSet signs) {
  return std::binary_search(descending.begin(), descending.end(), signs, std::greater<>());
}

}  // namespace

template <int K>
CornerCone<K> ConeOfSector(WallSet walls, const double* conormals, const Sector& sector) {
  std::vector<double> outward;
  ForEachWall(walls, [&](int wall) {
    const double sign = IsSubset(SetOfWall(wall), sector.signs) ? 1 : -1;
    for (int a = 0; a < K && IsSubset(SetOfWall(wall), sector.bounds); ++a)
      outward.push_back(sign * conormals[a]);
    conormals += K;
  });
  return ConeOf<K>(sector.bounds, outward.data());
}

// All signs of K independent walls occur. Each further wall leaves the cones that it does not cut
// on one side.
template <int K>
std::vector<WallSet> SignsAround(WallSet walls, const double* conormals, WallSet signs) {
  std::vector<WallSet> found;
  if constexpr (K > 1) {
    WallSet taken = BasisOf<K>(walls, conormals);
    for (WallSet part = taken;; part = (part - 1) & taken) {
      found.push_back((signs & ~walls) | part);
      if (part == 0) break;
    }
    ForEachWall(walls & ~taken, [&](int wall) {
      CheckInterruption(found.size());
      taken |= SetOfWall(wall);
      std::vector<WallSet> finer;
      for (const WallSet coarse : found)
        for (const WallSet side : {SetOfWall(wall), WallSet{0}})
          if (ConeOfSector<K>(walls, conormals, {coarse | side, taken}).has_interior)
            finer.push_back(coarse | side);
      found = std::move(finer);
    });
    std::sort(found.begin(), found.end(), std::greater<>());
  }
  return found;
}

template <int K>
std::vector<Sector> CornerSectors(const LabelTable& labels, WallSet walls, const double* conormals,
                                  WallSet signs) {
  const std::vector<WallSet> around = SignsAround<K>(walls, conormals, signs);
  std::vector<Sector> sectors;
  for (const WallSet sector : around) {
    if (labels.Of(sector) <= 0) continue;
    WallSet bounds = 0;
    ForEachWall(walls, [&](int wall) {
      if (Contains(around, sector ^ SetOfWall(wall))) bounds |= SetOfWall(wall);
    });
    sectors.push_back({sector, bounds});
  }
  return sectors;
}

#define STELLATE_EACH(K)                                                                   \
  template std::vector<WallSet> SignsAround<K>(WallSet, const double*, WallSet);           \
  template std::vector<Sector> CornerSectors<K>(const LabelTable&, WallSet, const double*, \
                                                WallSet);                                  \
  template CornerCone<K> ConeOfSector<K>(WallSet, const double*, const Sector&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
