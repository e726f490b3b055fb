#include "oracles/ready/grid_spline.h"

#include <algorithm>
#include <cmath>

#include "oracles/combined/common.h"

namespace stellate::oracles {
namespace {

// Values in a line into the coefficients of the spline through them: Unser's two recursions, with
// what mirroring at both ends says of their beginnings.
void ToCoefficients(double* line, std::ptrdiff_t count, std::ptrdiff_t stride) {
  const double pole = std::sqrt(3.0) - 2;
  const auto c = [line, stride](std::ptrdiff_t i) -> double& { return line[i * stride]; };
  for (std::ptrdiff_t i = 0; i < count; ++i) c(i) *= (1 - pole) * (1 - 1 / pole);
  const double across = std::pow(pole, static_cast<double>(count - 1));
  double power = pole, first = c(0) + across * c(count - 1);
  for (std::ptrdiff_t i = 1; i < count - 1; ++i, power *= pole) {
    first += power * (c(i) + across * c(count - 1 - i));
  }
  c(0) = first / (1 - across * across);
  for (std::ptrdiff_t i = 1; i < count; ++i) c(i) += pole * c(i - 1);
  c(count - 1) = (pole * c(count - 2) + c(count - 1)) * pole / (pole * pole - 1);
  for (std::ptrdiff_t i = count - 2; i >= 0; --i) c(i) = pole * (c(i + 1) - c(i));
}

}  // namespace

void GridSpline::Check(const Eigen::VectorXd& values, const std::vector<int>& shape,
                       const BoundingBox& box) {
  const std::ptrdiff_t d = std::ssize(shape);
  if (d == 0 || box.lower.size() != d || box.upper.size() != d ||
      !(box.lower.array() < box.upper.array()).all()) {
    Refuse("values on a grid of " + std::to_string(d) + " axes need a box of R^" +
           std::to_string(d) + ", lower < upper");
  }
  if (const int least = *std::min_element(shape.begin(), shape.end()); least < 4) {
    Refuse("a cubic spline needs 4 values an axis, and has " + std::to_string(least));
  }
  std::ptrdiff_t count = 1;
  for (const int side : shape) count *= side;
  if (count != values.size()) {
    Refuse("a grid of this shape has " + std::to_string(count) + " values, and there are " +
           std::to_string(values.size()));
  }
  if (!values.allFinite()) Refuse("values on the grid have to be finite");
}

GridSpline::GridSpline(Eigen::VectorXd values, std::vector<int> shape, const BoundingBox& box,
                       double outside)
    : coefficients_(std::move(values)), lower_(box.lower), shape_(std::move(shape)) {
  Check(coefficients_, shape_, box);
  const std::ptrdiff_t d = std::ssize(shape_);
  strides_.assign(static_cast<size_t>(d), 1);
  std::ptrdiff_t count = 1;
  for (std::ptrdiff_t a = d - 1; a >= 0; --a) {
    strides_[static_cast<size_t>(a)] = count;
    count *= shape_[static_cast<size_t>(a)];
  }
  spacing_.resize(d);
  for (std::ptrdiff_t a = 0; a < d; ++a) {
    const std::ptrdiff_t n = shape_[static_cast<size_t>(a)],
                         stride = strides_[static_cast<size_t>(a)];
    spacing_[a] = (box.upper[a] - lower_[a]) / static_cast<double>(n - 1);
    for (std::ptrdiff_t i = 0; i + stride < count; ++i) {
      if (i / stride % n + 1 == n) continue;
      const double change = std::abs(coefficients_[i + stride] - coefficients_[i]);
      steepness_ = std::max(steepness_, change / spacing_[a]);
    }
  }
  steepness_ *= outside;
  for (std::ptrdiff_t a = 0; a < d; ++a) {
    const std::ptrdiff_t n = shape_[static_cast<size_t>(a)],
                         stride = strides_[static_cast<size_t>(a)];
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      if (i / stride % n == 0) ToCoefficients(&coefficients_[i], n, stride);
    }
  }
}

// The nearest place of the box, and how far x is beyond it, along each axis in cells.
GridSpline::Place GridSpline::Locate(const Eigen::VectorXd& x) const {
  const Eigen::VectorXd place = (x - lower_).cwiseQuotient(spacing_);
  Place found{place, place};
  for (Eigen::Index a = 0; a < place.size(); ++a) {
    found.inside[a] = std::clamp(place[a], 0.0, shape_[static_cast<size_t>(a)] - 1.0);
  }
  found.beyond = place - found.inside;
  return found;
}

std::vector<GridSpline::Along> GridSpline::Around(const Eigen::VectorXd& inside) const {
  std::vector<Along> around(shape_.size());
  for (size_t a = 0; a < shape_.size(); ++a) {
    const double place = inside[static_cast<Eigen::Index>(a)];
    const std::ptrdiff_t last = shape_[a] - 1;
    const std::ptrdiff_t cell = std::min(static_cast<std::ptrdiff_t>(place), last - 1);
    const double t = place - static_cast<double>(cell), u = 1 - t;
    Along& along = around[a];
    for (std::ptrdiff_t i = 0; i < 4; ++i) {
      std::ptrdiff_t number = std::abs(cell + i - 1);
      if (number > last) number = 2 * last - number;
      along.at[i] = number * strides_[a];
    }
    const double weights[] = {u * u * u / 6, (t * t * (3 * t - 6) + 4) / 6,
                              (((3 - 3 * t) * t + 3) * t + 1) / 6, t * t * t / 6};
    const double slopes[] = {-u * u / 2, t * (9 * t - 12) / 6, (t * (6 - 9 * t) + 3) / 6,
                             t * t / 2};
    std::copy_n(weights, 4, along.weight);
    std::copy_n(slopes, 4, along.slope);
  }
  return around;
}

// The spline, or its derivative along one axis with lengths in cells (-1: none).
double GridSpline::Sum(const std::vector<Along>& around, int derived) const {
  double total = 0;
  const size_t corners = size_t{1} << (2 * around.size());
  for (size_t corner = 0; corner < corners; ++corner) {
    std::ptrdiff_t at = 0;
    double product = 1;
    for (size_t a = 0; a < around.size(); ++a) {
      const size_t i = corner >> (2 * a) & 3;
      at += around[a].at[i];
      product *= static_cast<int>(a) == derived ? around[a].slope[i] : around[a].weight[i];
    }
    total += product * coefficients_[at];
  }
  return total;
}

double GridSpline::Value(const Eigen::VectorXd& x) const {
  const Place place = Locate(x);
  return Sum(Around(place.inside), -1) + steepness_ * place.beyond.cwiseProduct(spacing_).norm();
}

Eigen::VectorXd GridSpline::Gradient(const Eigen::VectorXd& x) const {
  const Place place = Locate(x);
  const std::vector<Along> around = Around(place.inside);
  const Eigen::VectorXd away = place.beyond.cwiseProduct(spacing_);
  Eigen::VectorXd gradient(x.size());
  for (int a = 0; a < x.size(); ++a) {
    gradient[a] = away[a] != 0 ? steepness_ * away[a] / away.norm() : Sum(around, a) / spacing_[a];
  }
  return gradient;
}

}  // namespace stellate::oracles
