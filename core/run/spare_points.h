#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/certificate/mesh_view.h"
#include "core/refinement/candidate_set.h"

namespace stellate::core {

// Collects answers that were not inserted. They are known points of M: if the finished mesh is far
// from one, refinement continues from it.
class SparePoints {
 public:
  explicit SparePoints(int d) : d_(static_cast<std::size_t>(d)) {}

  // Keeps the answers that are not `used` (by candidate).
  void Keep(const AnsweredPoints& answers, const std::vector<std::uint8_t>& used);
  // Keeps the clearance of each answer, used or not. Drops the oldest beyond `most`.
  void KeepClearances(const AnsweredPoints& answers, std::size_t most);
  // Keeps a point of M as one where M ends, if the query was for one wall.
  void KeepEnd(const AnsweredPoints& answers, Eigen::Index c);
  // Returns the points that were not used and are far from the sample, d each.
  template <int K>
  std::vector<double> Uncovered(const Stars<K>& stars) const;

  // Returns one representative of each cluster of `points` (d each) that encroach on no face, d x
  // n, to be queried with tangents and sizes. Empty if there are none, or if this was done so often
  // that it does not help.
  template <int K>
  Eigen::MatrixXd Choose(const std::vector<double>& points, const Stars<K>& stars, double epsilon);

  // The same for points on walls, by wall.
  PlannedPoints ChooseOnWalls(const PointsOnWalls& points, double epsilon);

  // Give what is known to a certificate, and take it back with the answers to the certificate. Both
  // are without tangential offsets.
  KnownOfManifold Take() { return std::exchange(known_, {}); }
  void GiveBack(KnownOfManifold known) { known_ = std::move(known); }

 private:
  std::size_t d_;
  KnownOfManifold known_;  // without tangential offsets
  int chosen_ = 0;         // how often Choose returned points
};

}  // namespace stellate::core
