#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/interruption.h"
#include "core/execution.h"
#include "core/places.h"
#include "core/report.h"
#include "core/status.h"

namespace stellate::core {

inline constexpr int kMaxReconstructionDimension = 3;  // largest k

// How stars that disagree are made to agree.
enum class Weighting {
  kAuto = 0,  // by tilings, and by weights of points where these do not do
  // By weights of points alone: the result is the weighted tangential Delaunay complex (Chapter 3),
  // and is refused where stars disagree.
  kOnly = 1
};

// How to reconstruct a k-manifold M of R^d from points on it or near it (Chapter 3). Together with
// the points, in their order, it determines the result.
//
//   ReconstructionSpecification spec;
//   spec.dimension = 2, spec.ambient_dimension = 3;
//   spec.closed = false;  // M may end
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
  Weighting weights = Weighting::kAuto;  // kOnly: nothing is dropped or added
  // Whether points may be added (MostAdded) where nothing else makes the stars agree.
  bool steiner = false;
  // The caller promises that M's reach is at least this, a length. If the points have no noise, the
  // mesh may then be proved (docs/using/proof.md).
  std::optional<double> reach;
};

// Returns how many points may be added to so many.
inline std::uint64_t MostAdded(const ReconstructionSpecification& spec, std::uint64_t points) {
  return spec.steiner ? std::max<std::uint64_t>(points / 100, 16) : 0;
}

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

// A reconstruction. Its vertices are the given points, by their columns, and then those added;
// those that are merged or dropped are in no simplex.
struct Reconstruction {
  std::vector<std::uint32_t> simplices;  // k+1 ascending ids each, sorted
  std::vector<Place> places;             // by vertex
  Eigen::MatrixXd added;                 // d x (vertices that are none of the points)
  // (point, the earlier point that it equals), by the first.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> merged;
  // The positions that the complex was built on and is certified at, d x vertices; empty if they
  // are the given ones. Where the noise is large, the simplices may cross each other at the given
  // ones.
  Eigen::MatrixXd smoothed;
  Eigen::MatrixXd tangents;     // as PointCloud::tangents: given or estimated
  std::vector<double> weights;  // by vertex, squared lengths; empty if there are none
  std::vector<double> noise;    // by vertex: rms distance to the fitted surface around, length
  // Report::reconstruction is set. The certificate is about the complex at the smoothed positions
  // if there are any. Its level: kDecided  the complex is a closed manifold (or one with boundary),
  // its stars embed; the
  //           points say too little of M, and `certified` is false
  // kSampled  besides, the local evidence holds: noise, sheets, tilt
  // kProved   besides, the theorem holds of the declared reach
  Report report;
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
// progress at any time. Use one for one reconstruction; it must outlive that.
//
//   ReconstructionWatch watch;
//   std::thread reconstructing([&] { result = Reconstruct(spec, {points, {}}, {}, &watch); });
//   watch.Interrupt();
//   reconstructing.join();  // soon
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

// Reconstructs M. Errors: those of Validate, of each argument, and kCancelled. A result that is not
// certified is no error: its report says why, and its places say where.
//
//   const auto result = Reconstruct(spec, {points, {}});
//   if (result && result->report.certificate.certified) Use(result->simplices);
//
// Pure: the same points in the same order give the same bits, for any Execution.
Expected<Reconstruction> Reconstruct(const ReconstructionSpecification& spec,
                                     const PointCloud& cloud, Execution execution = {},
                                     ReconstructionWatch* watch = nullptr);

}  // namespace stellate::core
