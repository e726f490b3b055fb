#include "core/run/dimension_probe.h"

#include <algorithm>
#include <cmath>

#include "core/base/dense.h"
#include "core/base/random.h"

namespace stellate::core {
namespace {

// A corner of a polygon, and a point where sheets cross, have a neighbourhood that spans more than
// k directions: so many places are not all of that kind.
constexpr Eigen::Index kLeastPlaces = 3;
// More directions than M may have, lest those at hand be nearly dependent by chance. All are taken
// both ways: beside its surface a solid body has points to one side.
constexpr int kMoreDirections = 2;
// The distances from a vertex at which M is asked, in sizes of the mesh. What M's curvature adds to
// its tangent directions falls with the distance, and what noise adds grows by as much.
constexpr double kDistances[] = {1.0 / 64, 1.0 / 512};
constexpr double kLeastShareOfMove = 0.05;  // of the largest singular value: a direction of M
constexpr double kMostChange = 2;           // of a share, from one distance to the other

// Returns the singular values of the columns, as shares of the largest, the largest first.
Eigen::VectorXd SpanOf(const Eigen::MatrixXd& columns) {
  Eigen::VectorXd values = EigenvaluesOfSymmetric(columns.transpose() * columns).reverse();
  values = values.cwiseMax(0).cwiseSqrt();
  return values[0] > 0 ? (values / values[0]).eval() : values;
}

}  // namespace

DimensionProbe::DimensionProbe(const Specification& spec)
    : k_(spec.dimension),
      d_(spec.ambient_dimension),
      lines_(std::min(d_, k_ + kMoreDirections)),
      directions_(d_, 2 * lines_),
      policy_(spec) {
  Random random(spec.random_seed, static_cast<std::uint64_t>(directions_.size()));
  for (int i = 0; i < lines_; ++i) {
    auto direction = directions_.col(i);
    for (double& coordinate : direction) coordinate = random.NearlyNormal();
    direction.normalize();
    directions_.col(lines_ + i) = -direction;
  }
}

void DimensionProbe::Start(const Eigen::MatrixXd& places, const std::vector<double>& sizes) {
  found_.reset();
  places_ = places.cols() >= kLeastPlaces && k_ < d_ ? places : Eigen::MatrixXd();
  sizes_ = sizes;
}

// By place, by distance, by direction.
std::vector<QueryBlock> DimensionProbe::Questions() {
  if (!is_asking()) return {};
  QueryBlock block;
  block.kind = QueryKind::kClosestPoint;
  block.points.resize(d_, places_.cols() * directions_.cols() * std::ssize(kDistances));
  Eigen::Index column = 0;
  for (Eigen::Index place = 0; place < places_.cols(); ++place)
    for (const double step : kDistances)
      for (Eigen::Index i = 0; i < directions_.cols(); ++i)
        block.points.col(column++) =
            places_.col(place) +
            step * sizes_[static_cast<std::size_t>(place)] * directions_.col(i);
  policy_.AddWishes(&block);
  return {std::move(block)};
}

// Returns how many directions M has at a place, at both distances alike; 0 if that is not clear.
int DimensionProbe::RankAt(Eigen::Index place, const AnswerBlock& answer) const {
  Eigen::VectorXd shares[std::size(kDistances)];
  Eigen::Index column = place * directions_.cols() * std::ssize(kDistances);
  for (std::size_t s = 0; s < std::size(kDistances); ++s) {
    Eigen::MatrixXd moves(d_, directions_.cols());
    for (Eigen::Index i = 0; i < directions_.cols(); ++i, ++column) {
      if (!answer.found.empty() && !answer.found[static_cast<std::size_t>(column)]) return 0;
      moves.col(i) = answer.points.col(column) - places_.col(place);
    }
    shares[s] = SpanOf(moves);
  }
  int rank = 0;
  for (int i = 0; i < lines_; ++i) {
    const double far = shares[0][i], near = shares[1][i];
    const bool is_direction = std::min(far, near) >= kLeastShareOfMove &&
                              std::max(far, near) <= kMostChange * std::min(far, near);
    if (is_direction) rank = i + 1;
  }
  return rank;
}

void DimensionProbe::Absorb(const std::vector<AnswerBlock>& answers) {
  OtherDimension other{places_.col(0), 0, false, static_cast<int>(places_.cols())};
  for (Eigen::Index place = 0; place < places_.cols(); ++place) {
    const int rank = RankAt(place, answers.front());
    if (place > 0 && rank != other.dimension) other.dimension = 0;
    if (place == 0) other.dimension = rank;
  }
  other.is_at_least = other.dimension == lines_ && lines_ < d_;
  if (other.dimension > k_) found_ = std::move(other);
  places_.resize(0, 0);
}

}  // namespace stellate::core
