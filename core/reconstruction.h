#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/interruption.h"
#include "core/report.h"
#include "core/status.h"

namespace stellate::core {

inline constexpr int kMaxReconstructionDimension = 3;  // largest k

// How to reconstruct a k-manifold M of R^d from points on it or near it (Chapter 3). Together with
// the points, in their order, it determines the result; the number of threads does not.
//
//   ReconstructionSpecification spec;
//   spec.dimension = 2, spec.ambient_dimension = 3;
struct ReconstructionSpecification {
  int dimension = 0;          // k, 1 to kMaxReconstructionDimension
  int ambient_dimension = 0;  // d, k < d
  // Whether M has no boundary. If it may have one, the mesh ends where stars are open: the boundary
  // is kept instead of refused.
  bool closed = true;
  // The standard deviation of each coordinate from M, a length. 0: the points are on M. nullopt: as
  // the points show.
  std::optional<double> noise;
  // The share of the points that may be left out where the others make a manifold and all do not;
  // in [0, 0.5].
  double drop = 0.001;
  // The caller promises that M's reach is at least this, a length. If the points have no noise, the
  // mesh may then be proved (docs/using/proof.md).
  std::optional<double> reach;
  int threads = 0;  // 0: all cores
};

// Returns kInvalidArgument or kLimitExceeded with the offending field and value, else Ok.
Status Validate(const ReconstructionSpecification& spec);

// The points, and tangent spaces if the caller has them.
struct PointCloud {
  Eigen::MatrixXd points;  // d x n: each column is a point, so that memory holds n rows of d
  // (d k) x n, entry i*k + a of a column is coordinate i of tangent vector a (QueryBlock::bases);
  // orthonormal. Empty: they are estimated.
  Eigen::MatrixXd tangents;
};

// Returns kInvalidArgument for what no reconstruction can begin with: a wrong shape, NaN, infinity
// or an absurd size in a coordinate, too few points, tangent vectors that are not orthonormal.
Status Validate(const ReconstructionSpecification& spec, const PointCloud& cloud);

// What became of a point. The numbers are on the wire, and never change.
enum class Place : std::uint8_t {
  kOk = 0,        // its star was right as it was built
  kMerged = 1,    // equals an earlier point, which stands for it; in no simplex
  kDropped = 2,   // left out (ReconstructionSpecification::drop); in no simplex
  kTiled = 3,     // stars disagreed around it; a tiling of the place agrees
  kWeighted = 4,  // has a weight, by which stars agree
  // What is not resolved has one of these, the first that applies.
  kEdge = 5,      // its star is open: M ends here, or has a hole in the sample
  kSheets = 6,    // another part of M is as near as its neighbours
  kNoise = 7,     // the noise is more than half of the spacing
  kSparse = 8,    // tangent spaces turn too much from neighbour to neighbour: too few points
  kClose = 9,     // another point is much nearer than the spacing
  kDisagree = 10  // stars disagree for no such reason
};
const char* PlaceName(Place place);    // "OK", "MERGED", ...
const char* PlaceAdvice(Place place);  // one plain sentence: the cause and the cure
inline constexpr int kPlaces = 11;

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
  // "more than 4".
  double looks[5] = {};
};

// A reconstruction. Its vertices are the given points, by their columns; those that are merged or
// dropped are in no simplex.
struct Reconstruction {
  std::vector<std::uint32_t> simplices;  // k+1 ascending ids each, sorted
  std::vector<Place> places;             // by point
  // (point, the earlier point that it equals), by the first.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> merged;
  // The positions that the complex was built on and is certified at, d x n; empty if they are the
  // given ones. Where the noise is large, the simplices may cross each other at the given ones.
  Eigen::MatrixXd smoothed;
  Eigen::MatrixXd tangents;     // as PointCloud::tangents: given or estimated
  std::vector<double> weights;  // by point, squared lengths; empty if there are none
  std::vector<double> noise;    // by point: rms distance to the fitted surface around, length
  // The certificate is about the complex at the smoothed positions if there are any. Its level:
  // kDecided  the complex is a closed manifold (or one with boundary), its stars embed; the
  //           points say too little of M, and `certified` is false
  // kSampled  besides, the local evidence holds: noise, sheets, tilt
  // kProved   besides, the theorem holds of the declared reach
  Report report;
  ReconstructionCounts counts;
};

enum class ReconstructionPhase {
  kIndexing = 0,  // the points are checked and sorted into a search tree
  kFitting,       // tangent spaces, noise
  kBuilding,      // stars
  kFilling,       // cavities, where stars disagree
  kCertifying,
  kDone
};
const char* ReconstructionPhaseName(ReconstructionPhase phase);  // "INDEXING", ...

struct ReconstructionProgress {
  ReconstructionPhase phase = ReconstructionPhase::kIndexing;
  double fraction = 0;  // estimated share of the work done, 0..1; never falls
};

// Watches and interrupts a reconstruction in another thread. Any thread may call Interrupt and
// progress at any time.
class ReconstructionWatch {
 public:
  // Makes Reconstruct return soon with kCancelled, for good.
  void Interrupt() { interruption_.Raise(); }
  ReconstructionProgress progress() const {
    return {static_cast<ReconstructionPhase>(phase_.load()), fraction_.load()};
  }

  // For Reconstruct.
  Interruption& interruption() { return interruption_; }
  void Advance(ReconstructionPhase phase, double fraction);

 private:
  Interruption interruption_;
  std::atomic<int> phase_ = 0;
  std::atomic<double> fraction_ = 0;
};

// Reconstructs M. Errors: those of both Validate, and kCancelled. A result that is not certified is
// no error: its report says why, and its places say where.
//
//   const auto result = Reconstruct(spec, {points, {}});
//   if (result && result->report.certificate.certified) Use(result->simplices);
//
// Pure: the same points in the same order give the same bits, for any number of threads.
Expected<Reconstruction> Reconstruct(const ReconstructionSpecification& spec,
                                     const PointCloud& cloud, ReconstructionWatch* watch = nullptr);

}  // namespace stellate::core
