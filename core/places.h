#pragma once

#include <cstdint>

namespace stellate::core {

// What became of a point. The numbers are on the wire, and never change.
//
//   for (const Place place : result->places)
//     if (place == Place::kNoise) std::cerr << PlaceName(place) << ": " << PlaceAdvice(place);
enum class Place : std::uint8_t {
  kOk = 0,        // its star was right as it was built
  kMerged = 1,    // equals an earlier point, which stands for it; in no simplex
  kDropped = 2,   // left out (ReconstructionSpecification::drop); in no simplex
  kTiled = 3,     // stars disagreed around it; a tiling of the place agrees
  kWeighted = 4,  // has a weight, by which stars agree
  // What is not resolved has one of these, the first that applies.
  kEdge = 5,    // its star is open: M ends here, or has a hole in the sample
  kSheets = 6,  // another part of M is as near as its neighbours
  kNoise = 7,   // the noise is more than half of the spacing; or M has a crease or a corner there
  kSparse = 8,  // tangent spaces turn too much from neighbour to neighbour: too few points
  kClose = 9,   // another point is much nearer than the spacing
  kDisagree = 10,  // stars disagree for no such reason
  kAdded = 11      // is none of the points (ReconstructionSpecification::steiner)
};
const char* PlaceName(Place place);    // "OK", "MERGED", ...
const char* PlaceAdvice(Place place);  // one plain sentence: the cause and the cure
inline constexpr int kPlaces = 12;

// What was found on the way, besides the certificate.
struct ReconstructionCounts {
  std::uint64_t places[kPlaces] = {};  // points, by Place
  double spacing = 0;                  // median distance of a point to its nearest, length
  double noise = 0;            // median rms distance of points to the fitted surface, length
  double noise_ratio = 0;      // the same in units of the local spacing
  bool smoothed = false;       // the complex was built on copies moved to the fitted surface
  std::uint64_t doubtful = 0;  // simplices about which stars disagreed at first
  std::uint64_t cavities = 0;  // the places that they made up
  std::uint64_t tiles = 0;     // simplices of tilings
  std::uint64_t unfilled_vertices = 0;  // vertices of cavities that were left
  // The share of points around which the points look this many-dimensional, by k = 0 to 4; 0 is
  // "more than 4". All 0 where tangent spaces were given.
  double looks[5] = {};
};

}  // namespace stellate::core
