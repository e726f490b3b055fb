#pragma once

#include <Eigen/Core>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "stellate/oracle.h"

// What the ready oracles share.
namespace stellate::oracles {

// A basis as a column of a batch, see Oracle.
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

[[noreturn]] inline void Refuse(const std::string& why) { throw std::invalid_argument(why); }

// What is made of a manifold with boundary would have none.
inline void RefuseWalls(const Oracle& oracle, const std::string& made) {
  if (oracle.walls() > 0) Refuse(made + " is made of manifolds without boundary: clip it instead");
}

// What the oracles that another is made of say of themselves, each thing once.
std::string AboutOf(const std::vector<std::shared_ptr<Oracle>>& parts);

// To six digits.
std::string Short(double number);

// Points in columns, `what` they are: refused unless there are some and all are finite.
void CheckPoints(const Eigen::MatrixXd& points, const std::string& what);

// The points' box, wider by a share of its diagonal at each side.
BoundingBox BoxAround(const Eigen::MatrixXd& points, double share);

// The box that an oracle has; else a cube about its seeds with the diagonal of their box, or with 1
// where there are no two seeds.
BoundingBox WhereOf(const Oracle& oracle);
// How large a manifold is, by where it says to look for it.
double ScaleOf(const Oracle& oracle);

// The share of all values that is not above it, between values along a line; values are not empty.
double Quantile(std::vector<double> values, double share);

// matrix * each column alone: a product of whole matrices may round a column by how many there are.
Eigen::MatrixXd EachTimes(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& columns);

// Central differences of f: R^d -> R^m at x, m x d, with the step that is best for values of about
// `scale`.
template <typename Function>
Eigen::MatrixXd Differences(const Function& f, const Eigen::VectorXd& x, double scale) {
  constexpr double kStep = 6e-6;  // about the cube root of rounding
  const double h = kStep * scale;
  Eigen::MatrixXd result;
  Eigen::VectorXd y = x;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    y[i] = x[i] + h;
    const Eigen::VectorXd ahead = f(y);
    y[i] = x[i] - h;
    if (i == 0) result.resize(ahead.size(), x.size());
    result.col(i) = (ahead - f(y)) / (2 * h);
    y[i] = x[i];
  }
  return result;
}

}  // namespace stellate::oracles
