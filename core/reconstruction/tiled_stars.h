#pragma once

#include <cstdint>
#include <vector>

#include "core/base/instantiate.h"
#include "core/reconstruction/fitted_cloud.h"
#include "core/specification.h"

namespace stellate::core {

// How the stars of a cloud, or of a part of it, are built.
struct TilingRequest {
  std::vector<std::uint32_t> ids;  // the points, ascending
  CentreRule rule = CentreRule::kTangentSpace;
  // By point of the cloud, squared lengths; null: none.
  const std::vector<double>* weights = nullptr;
  double spacing = 0;  // a typical one of the whole cloud, length
  bool tiles = true;   // false: all cavities are left, even where nothing is missing
};

// The stars' consistent simplices, and tilings of the cavities where stars disagree, by ids of the
// cloud.
struct TiledStars {
  std::vector<std::uint32_t> simplices;  // k+1 ascending ids each, sorted
  std::vector<std::uint32_t> unfilled;   // vertices of the cavities that are left, ascending
  std::vector<std::uint32_t> tiled;      // vertices of the cavities that are tiled, ascending
  std::vector<double> radii;  // by place in `ids`: the star's largest circumradius, infinite if it
                              // is open
  std::uint64_t doubtful = 0, cavities = 0, tiles = 0;
};

template <int K>
TiledStars BuildTiledStars(const FittedCloud& cloud, const TilingRequest& request);

}  // namespace stellate::core
