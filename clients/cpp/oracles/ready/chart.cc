#include <cmath>

#include "oracles/combined/common.h"
#include "oracles/exactness.h"
#include "oracles/ready/atlas.h"

namespace stellate::oracles {
namespace {

constexpr double kFirstStep = 6e-6;   // of first differences: about the cube root of rounding
constexpr double kSecondStep = 1e-4;  // of second ones: about its fourth root; shares of the box

}  // namespace

CheckedChart::CheckedChart(Chart chart, size_t number)
    : chart_(std::move(chart)), name_("chart " + std::to_string(number)) {
  const Eigen::VectorXd &lower = chart_.lower, &upper = chart_.upper;
  if (!chart_.x) Refuse(name_ + " has no map x");
  if (lower.size() == 0 || lower.size() != upper.size() || !(lower.array() < upper.array()).all()) {
    Refuse(name_ + " needs corners lower < upper");
  }
  extent_ = upper - lower;
  if (!extent_.allFinite()) Refuse(name_ + "'s box has to be finite");
  if (chart_.periodic.size() <= 1) {
    chart_.periodic.assign(static_cast<size_t>(k()),
                           !chart_.periodic.empty() && chart_.periodic.front());
  }
  if (std::ssize(chart_.periodic) != k()) {
    Refuse(name_ + " has " + std::to_string(k()) + " parameters and says of " +
           std::to_string(chart_.periodic.size()) + " whether they are periodic");
  }
  d_ = Point((lower + upper) / 2).size();
}

void CheckedChart::InsistOnExactness() const {
  Exactness(name_ + "'s x", {chart_.lower, chart_.upper}).Insist(chart_.x);
}

Eigen::VectorXd CheckedChart::Point(const Eigen::VectorXd& u) const {
  Eigen::VectorXd point = chart_.x(u);
  if (d_ == 0 || point.size() == d_) return point;
  throw std::runtime_error(name_ + "'s x returned " + std::to_string(point.size()) +
                           " numbers, and before " + std::to_string(d_));
}

Eigen::MatrixXd CheckedChart::Slopes(const Eigen::VectorXd& u) const {
  if (chart_.derivative) {
    Eigen::MatrixXd slopes = chart_.derivative(u);
    if (slopes.rows() == d_ && slopes.cols() == k()) return slopes;
    throw std::runtime_error(name_ + "'s derivative returned a matrix " +
                             std::to_string(slopes.rows()) + " x " + std::to_string(slopes.cols()) +
                             "; it has to be " + std::to_string(d_) + " x " + std::to_string(k()));
  }
  Eigen::MatrixXd slopes(d_, k());
  for (Eigen::Index a = 0; a < k(); ++a) {
    Eigen::VectorXd ahead = u, behind = u;
    ahead[a] += kFirstStep * extent_[a];
    behind[a] -= kFirstStep * extent_[a];
    if (!wraps(a)) {
      ahead[a] = std::min(ahead[a], chart_.upper[a]);
      behind[a] = std::max(behind[a], chart_.lower[a]);
    }
    slopes.col(a) = (Point(ahead) - Point(behind)) / (ahead[a] - behind[a]);
  }
  return slopes;
}

Eigen::MatrixXd CheckedChart::Bend(const Eigen::VectorXd& u, const Eigen::VectorXd& r) const {
  const Eigen::VectorXd steps = kSecondStep * extent_;
  // About a place from which all differences stay in the box: no second difference is one-sided.
  Eigen::VectorXd middle = u;
  for (Eigen::Index a = 0; a < k(); ++a) {
    if (wraps(a)) continue;
    middle[a] = std::clamp(u[a], chart_.lower[a] + steps[a], chart_.upper[a] - steps[a]);
  }
  const Eigen::VectorXd here = Point(middle);
  const auto second = [&](Eigen::Index a, Eigen::Index b, double sign) {
    Eigen::VectorXd v = Eigen::VectorXd::Zero(k());
    v[a] = steps[a];
    if (a != b) v[b] = sign * steps[b];
    return r.dot(Point(middle + v) - 2 * here + Point(middle - v));
  };
  Eigen::MatrixXd bend(k(), k());
  for (Eigen::Index a = 0; a < k(); ++a) {
    bend(a, a) = second(a, a, 1) / (steps[a] * steps[a]);
    for (Eigen::Index b = 0; b < a; ++b) {
      bend(a, b) = (second(a, b, 1) - second(a, b, -1)) / (4 * steps[a] * steps[b]);
      bend(b, a) = bend(a, b);
    }
  }
  return bend;
}

Eigen::VectorXd CheckedChart::Inside(const Eigen::VectorXd& u) const {
  Eigen::VectorXd inside = u;
  for (Eigen::Index a = 0; a < k(); ++a) {
    if (wraps(a)) {
      inside[a] -= extent_[a] * std::floor((u[a] - chart_.lower[a]) / extent_[a]);
    } else {
      inside[a] = std::clamp(u[a], chart_.lower[a], chart_.upper[a]);
    }
  }
  return inside;
}

Chart CheckedChart::DividedBy(const Eigen::VectorXd& scale) const {
  Chart divided = chart_;
  divided.x = [x = chart_.x, scale](const Eigen::VectorXd& u) -> Eigen::VectorXd {
    return x(u).cwiseQuotient(scale);
  };
  if (!chart_.derivative) return divided;
  divided.derivative = [own = chart_.derivative, scale](const Eigen::VectorXd& u) {
    Eigen::MatrixXd slopes = own(u);
    slopes.array().colwise() /= scale.array();
    return slopes;
  };
  return divided;
}

}  // namespace stellate::oracles
