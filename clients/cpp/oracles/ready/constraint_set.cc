#include <random>

#include "oracles/combined/common.h"
#include "stellate/oracles/equations.h"

namespace stellate::oracles {
namespace {

constexpr int kLooks = 64;  // points of the box that constraints are looked at from
// What is left of a gradient across those before it, as a share, where it follows from them; and a
// gradient where it is none, as a share of what it is elsewhere. Far above what differences err by.
constexpr double kDependent = 1e-6;

Eigen::MatrixXd PointsOf(const BoundingBox& box) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> share(0, 1);
  Eigen::MatrixXd points(box.lower.size(), kLooks);
  for (double& number : points.reshaped()) number = share(random);
  return ((box.upper - box.lower).asDiagonal() * points).colwise() + box.lower;
}

// Where each equation of all constraints comes from.
std::vector<size_t> OwnersOf(const std::vector<Constraint>& constraints, const BoundingBox& box) {
  if (constraints.empty()) Refuse("a constraint set needs one constraint at least");
  std::vector<size_t> owners;
  for (size_t i = 0; i < constraints.size(); ++i) {
    if (!constraints[i].f) Refuse("constraint " + std::to_string(i) + " has to be a function");
    const Eigen::VectorXd value = constraints[i].f((box.lower + box.upper) / 2);
    owners.insert(owners.end(), static_cast<size_t>(value.size()), i);
  }
  return owners;
}

int DimensionOf(int ambient_dimension, const std::vector<Constraint>& constraints,
                const BoundingBox& box) {
  if (box.lower.size() != ambient_dimension || box.upper.size() != ambient_dimension) {
    Refuse("a constraint set needs a bounding box of R^" + std::to_string(ambient_dimension));
  }
  const size_t count = OwnersOf(constraints, box).size();
  if (count < 1 || count >= static_cast<size_t>(ambient_dimension)) {
    Refuse(std::to_string(count) + " equations in R^" + std::to_string(ambient_dimension) +
           " leave no manifold");
  }
  return ambient_dimension - static_cast<int>(count);
}

ImplicitOracle::Function AllOf(const std::vector<Constraint>& constraints) {
  return [constraints](const Eigen::VectorXd& x) {
    Eigen::VectorXd all;
    for (const Constraint& one : constraints) {
      const Eigen::VectorXd value = one.f(x);
      all.conservativeResize(all.size() + value.size());
      all.tail(value.size()) = value;
    }
    return all;
  };
}

ImplicitOracle::Jacobian SlopesOf(const std::vector<Constraint>& constraints, double scale) {
  return [constraints, scale](const Eigen::VectorXd& x) {
    Eigen::MatrixXd all(0, x.size());
    for (const Constraint& one : constraints) {
      const Eigen::MatrixXd slopes = one.jacobian ? one.jacobian(x) : Differences(one.f, x, scale);
      all.conservativeResize(all.rows() + slopes.rows(), Eigen::NoChange);
      all.bottomRows(slopes.rows()) = slopes;
    }
    return all;
  };
}

// The first row that lies in the span of those before it, or is none beside its usual length; -1:
// there is none such.
Eigen::Index FirstDependent(const Eigen::MatrixXd& slopes, const Eigen::VectorXd& usual) {
  Eigen::MatrixXd across(slopes.rows(), slopes.cols());
  for (Eigen::Index i = 0; i < slopes.rows(); ++i) {
    const double whole = slopes.row(i).norm();
    Eigen::VectorXd left = slopes.row(i).transpose() / std::max(whole, 1e-300);
    for (Eigen::Index j = 0; j < i; ++j) {
      left -= across.row(j).dot(left) * across.row(j).transpose();
    }
    if (!(left.norm() > kDependent) || !(whole > kDependent * usual[i])) return i;
    across.row(i) = left.normalized();
  }
  return -1;
}

// The median of each row's lengths.
Eigen::VectorXd UsualLengths(const std::vector<Eigen::MatrixXd>& slopes) {
  Eigen::VectorXd usual(slopes.front().rows());
  for (Eigen::Index i = 0; i < usual.size(); ++i) {
    std::vector<double> lengths;
    lengths.reserve(slopes.size());
    for (const Eigen::MatrixXd& one : slopes) lengths.push_back(one.row(i).norm());
    usual[i] = Quantile(std::move(lengths), 0.5);
  }
  return usual;
}

}  // namespace

// The base class keeps what these become, and the box.
// NOLINTNEXTLINE(performance-unnecessary-value-param)
ConstraintSet::ConstraintSet(int ambient_dimension, std::vector<Constraint> constraints,
                             BoundingBox box)  // NOLINT(performance-unnecessary-value-param)
    : ImplicitOracle(DimensionOf(ambient_dimension, constraints, box), ambient_dimension,
                     AllOf(constraints), SlopesOf(constraints, (box.upper - box.lower).norm()),
                     box) {
  const std::vector<size_t> owners = OwnersOf(constraints, box);
  const Jacobian slopes = SlopesOf(constraints, (box.upper - box.lower).norm());
  const Eigen::MatrixXd looks = PointsOf(box);
  std::vector<Eigen::MatrixXd> there;
  for (const auto& x : looks.colwise()) there.push_back(slopes(x));
  const Eigen::VectorXd usual = UsualLengths(there);
  std::vector<int> dependent(constraints.size(), 0);
  for (const Eigen::MatrixXd& one : there) {
    const Eigen::Index row = FirstDependent(one, usual);
    if (row >= 0) ++dependent[owners[static_cast<size_t>(row)]];
  }
  for (size_t i = 0; i < constraints.size(); ++i) {
    if (dependent[i] < kLooks) continue;
    Refuse("constraint " + std::to_string(i) + " follows from those before it: leave it out");
  }
  Eigen::VectorXd y;
  int found = 0;
  for (const auto& x : looks.colwise()) {
    if (!Project(x, y)) continue;
    ++found;
    if (const Eigen::Index row = FirstDependent(slopes(y), usual); row >= 0) {
      Refuse(
          "constraint " + std::to_string(owners[static_cast<size_t>(row)]) +
          " has no gradient of its own where all constraints hold: the set is no manifold there");
    }
  }
  if (found == 0) {
    Refuse("no point was found where all constraints hold, from " + std::to_string(kLooks) +
           " points of the box");
  }
}

}  // namespace stellate::oracles
