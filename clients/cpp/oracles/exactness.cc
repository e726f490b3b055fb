#include "exactness.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <random>
#include <utility>
#include <vector>

namespace stellate {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr Index kLines = 12;   // that the exactness of a function is measured along
constexpr size_t kFewest = 3;  // of them that have to tell it
// Of a line's five places, in shares of the box: no smooth function bends in so little. Single
// precision far from the origin does not tell them apart: then those of the second length.
constexpr double kSteps[] = {1e-6, 1e-4};
// Their fourth difference is, of what is not smooth, so many times the error of a value.
constexpr double kFourth[] = {1, -4, 6, -4, 1};
const double kFourthSize = std::sqrt(70.0);
// The most that values may err by, as a length in shares of the box: a hundred times what points
// are found to. Single precision errs by some 1e-8, double by 1e-16.
constexpr double kInexact = 1e-10;
// An error of no more than this share of a value is its own rounding: next to a level, where values
// are small, it is not there. Densities far from what they are dense in are all but the level.
constexpr double kOwnRounding = 16 * std::numeric_limits<double>::epsilon();
// Likewise, of the largest coordinate.
constexpr double kCoordinateRoundings = 1600 * std::numeric_limits<double>::epsilon();

struct Share {
  double error = 0;             // how far the zero set moves by f's errors, in shares of the box
  Index value = 0, values = 1;  // by which of how many values of f
};

double MedianOf(std::vector<double> numbers) {
  const auto middle = numbers.begin() + std::ssize(numbers) / 2;
  std::nth_element(numbers.begin(), middle, numbers.end());
  return *middle;
}

MatrixXd RandomWays(const VectorXd& sides, std::mt19937_64* random) {
  std::normal_distribution<double> number;
  MatrixXd ways(sides.size(), kLines);
  for (double& entry : ways.reshaped()) entry = number(*random);
  return sides.asDiagonal() * ways.colwise().normalized();
}

// Along short lines a smooth function is a straight one, which its fourth differences show no more
// than rounding of.
Share Measure(const Exactness::Function& f, const MatrixXd& starts, const MatrixXd& ways) {
  for (const double step : kSteps) {
    std::vector<std::vector<double>> shares;  // of each value, on each line that tells any
    for (Index line = 0; line < kLines; ++line) {
      VectorXd fourth, first, last, largest;
      for (int i = 0; i < 5; ++i) {
        last = f(starts.col(line) + step * (i - 2) * ways.col(line));
        if (i == 0) first = last;
        if (i == 0) fourth = largest = VectorXd::Zero(last.size());
        if (last.size() != first.size()) return {};
        fourth += kFourth[i] * last;
        largest = largest.cwiseMax(last.cwiseAbs());
      }
      shares.resize(std::max(shares.size(), static_cast<size_t>(last.size())));
      for (Index value = 0; value < last.size(); ++value) {
        const double error = std::abs(fourth[value]) / kFourthSize;
        const double share = error * (4 * step) / std::abs(last[value] - first[value]);
        if (std::isfinite(share) && error > kOwnRounding * largest[value])
          shares[static_cast<size_t>(value)].push_back(share);
      }
    }
    Share worst{-1, 0, std::ssize(shares)};
    for (size_t value = 0; value < shares.size(); ++value) {
      if (shares[value].size() < kFewest) continue;
      const double usual = MedianOf(shares[value]);
      if (usual > worst.error) worst = {usual, static_cast<Index>(value), worst.values};
    }
    if (worst.error >= 0) return worst;
  }
  return {};
}

}  // namespace

Exactness::Exactness(std::string name, BoundingBox box, MatrixXd about)
    : name_(std::move(name)), box_(std::move(box)), about_(std::move(about)) {}

void Exactness::Insist(const Function& f) const {
  std::call_once(once_, [&] { fault_ = Judge(f); });
  if (!fault_.empty()) throw OracleError("ORACLE_PRECISION", fault_);
}

std::string Exactness::Judge(const Function& f) const {
  const VectorXd sides = (box_.upper - box_.lower).cwiseMax(1e-300);
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> share(0, 1);
  MatrixXd starts(sides.size(), kLines);
  for (Index j = 0; j < kLines; ++j) {
    if (about_.cols() > 0 && about_.rows() == sides.size()) {
      starts.col(j) = about_.col(j % about_.cols());
      continue;
    }
    for (Index i = 0; i < sides.size(); ++i) {
      starts(i, j) = box_.lower[i] + sides[i] * share(random);
    }
  }
  const Share seen = Measure(f, starts, RandomWays(sides, &random));
  const double far =
      (box_.lower.cwiseAbs().cwiseMax(box_.upper.cwiseAbs()).array() / sides.array()).maxCoeff();
  if (!(seen.error > std::max(kInexact, kCoordinateRoundings * far))) return {};
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.1g", seen.error);
  const std::string which =
      seen.values == 1 ? name_ : name_ + "'s value " + std::to_string(seen.value);
  return which + " is exact to " + digits +
         " of its box at best, as neighbouring points show, which is what single precision does. "
         "Points are found to twelve digits, which takes doubles throughout, within the function "
         "as well; what is solved or integrated inside it takes as many digits";
}

}  // namespace stellate
