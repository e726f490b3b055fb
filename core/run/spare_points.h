#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/certificate/mesh_view.h"
#include "core/refinement/candidate_set.h"

namespace stellate::core {

// Answers that were not inserted are known points of M all the same: where the finished mesh has
// nothing near one, refinement goes on from there.
class SparePoints {
 public:
  explicit SparePoints(int d) : d_(static_cast<std::size_t>(d)) {}

  // Keeps what was answered and not used; `used` by candidate.
  void Keep(const AnsweredPoints& answers, const std::vector<std::uint8_t>& used);
  // Keeps a point of M for one that M ends at, if it was asked for on one wall.
  void KeepEnd(const AnsweredPoints& answers, Eigen::Index c);
  // Those that the sample covers nowhere near, d each.
  template <int K>
  std::vector<double> Uncovered(const StarComplex<K>& complex) const;

  // Of `points`, d each, one of those that lie together: to be asked for with all that inserting
  // them needs, d x n. Empty if there are none, or if that was done so often that it does not help.
  template <int K>
  Eigen::MatrixXd Choose(const std::vector<double>& points, const StarComplex<K>& complex,
                         double epsilon);

  // The same of points on walls, of each wall one of those that lie together.
  PlannedPoints ChooseOnWalls(const PointsOnWalls& points, double epsilon);

  // To and from a certificate, d each.
  std::vector<double> Take() { return std::move(points_); }
  const EndsOfManifold& ends() const { return ends_; }
  void GiveBack(std::vector<double> points) { points_ = std::move(points); }

 private:
  std::size_t d_;
  std::vector<double> points_;  // d each
  EndsOfManifold ends_;
  int chosen_ = 0;  // times that Choose had some
};

}  // namespace stellate::core
