#include "core/complex/sample.h"

#include <cmath>
#include <utility>

#include "core/base/basis_layout.h"
#include "core/base/capacity.h"
#include "core/complex/corner_sectors.h"

namespace stellate::core {

template <int K>
Sample<K>::Sample(int d, double epsilon, LabelTable labels)
    : d_(d),
      epsilon_(epsilon),
      weight_scale_(1e-10 * epsilon * epsilon),
      points_(d),
      sectors_(std::move(labels)),
      boundary_points_(d) {}

template <int K>
std::uint32_t Sample<K>::Add(const double* point, const double* tangent, WallSet walls,
                             const double* conormals, WallSet signs) {
  const std::uint32_t id = size();
  if (const LabelTable& labels = sectors_.labels(); !labels.empty())
    sectors_.Add(walls, signs,
                 labels.Codimension(walls) > K ? CornerSectors<K>(labels, walls, conormals, signs)
                                               : sectors_.Of(walls, signs));
  if (walls != 0) {
    walls_.resize(id, 0);
    walls_.push_back(walls);
    conormals_at_.resize(id, 0);
    conormals_at_.push_back(static_cast<std::uint32_t>(conormals_.size()));
    conormals_.insert(conormals_.end(), conormals, conormals + K * CountWalls(walls));
    boundary_.push_back(id);
    boundary_points_.Add(point);
  }
  ReserveMore(stride() * K, &tangents_);
  tangents_.insert(tangents_.end(), tangent, tangent + d_ * K);
  points_.Add(point);
  return id;
}

template <int K>
void Sample<K>::AddUnindexed(const double* point, const double* tangent, double bound) {
  points_.AddUnindexed(point);
  tangents_.insert(tangents_.end(), tangent, tangent + d_ * K);
  if (bound > 0) bounds_.push_back(bound);
}

template <int K>
void Sample<K>::Index(BallTree::Halving halving, std::size_t parts) {
  points_.Index(halving);
  if (parts == 0) return;
  points_.FitCapacity(parts);
  FitCapacity(parts, &tangents_);
}

template <int K>
void Sample<K>::NameLast(std::uint32_t name) {
  const std::uint32_t last = size() - 1;
  if (name == last) return;
  for (auto id = static_cast<std::uint32_t>(names_.size()); id < last; ++id) names_.push_back(id);
  names_.push_back(name);
}

template <int K>
void Sample<K>::SetProtectingBalls(std::vector<double> radii2) {
  protecting_radii2_ = std::move(radii2);
  largest_protecting_radius2_ =
      protecting_radii2_.empty()
          ? 0
          : *std::max_element(protecting_radii2_.begin(), protecting_radii2_.end());
  centre_owner_ = {};
}

template <int K>
Eigen::MatrixXd Sample<K>::TangentMatrix() const {
  Eigen::MatrixXd matrix(d_ * K, size());
  for (std::uint32_t p = 0; p < size(); ++p)
    ToByCoordinate(Tangent(p), d_, K, matrix.col(p).data());
  return matrix;
}

template <int K>
bool Sample<K>::InProtectingBall(const double* point) const {
  if (!has_protecting_balls()) return false;
  bool in = false;
  tree().VisitNear(
      point, [&] { return std::sqrt(largest_protecting_radius2_); },
      [&](std::uint32_t id, double distance2) { in = in || distance2 < ProtectingRadius2(id); });
  return in;
}

template <int K>
void Sample<K>::Lift(std::uint32_t p, const double* x, double* point) const {
  const double* at = Point(p);
  const double* tangent = Tangent(p);
  for (int i = 0; i < d_; ++i) {
    double s = at[i];
    for (int a = 0; a < K; ++a) s += x[a] * tangent[a * d_ + i];
    point[i] = s;
  }
}

template <int K>
int Sample<K>::Nearest(const double* q, int count,
                       std::pair<double, std::uint32_t>* nearest) const {
  return FindNearest(tree(), q, count, nearest);
}

STELLATE_INSTANTIATE_CLASS(Sample)

}  // namespace stellate::core
