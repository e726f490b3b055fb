#include "oracles/combined/common.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace stellate::oracles {

std::string AboutOf(const std::vector<std::shared_ptr<Oracle>>& parts) {
  std::vector<std::string> known;
  std::string all;
  for (const auto& part : parts) {
    const std::string about = part->about();
    if (about.empty() || std::find(known.begin(), known.end(), about) != known.end()) continue;
    known.push_back(about);
    all += (all.empty() ? "" : "; ") + about;
  }
  return all;
}

std::string Short(double number) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", number);
  return text;
}

void CheckPoints(const Eigen::MatrixXd& points, const std::string& what) {
  if (points.size() == 0) Refuse(what + " have to be a matrix, one a column, and there are none");
  for (Eigen::Index j = 0; j < points.cols(); ++j) {
    if (!points.col(j).allFinite())
      Refuse(what + ": column " + std::to_string(j) + " is not finite");
  }
}

BoundingBox BoxAround(const Eigen::MatrixXd& points, double share) {
  const Eigen::VectorXd lower = points.rowwise().minCoeff(), upper = points.rowwise().maxCoeff();
  const double margin = share * (upper - lower).norm();
  return {lower.array() - margin, upper.array() + margin};
}

BoundingBox WhereOf(const Oracle& oracle) {
  if (const auto box = oracle.bounding_box()) return *box;
  const int d = oracle.ambient_dimension();
  Eigen::MatrixXd seeds = oracle.seeds();
  if (seeds.cols() == 0 || seeds.rows() != d) seeds = Eigen::MatrixXd::Zero(d, 1);
  const Eigen::VectorXd lower = seeds.rowwise().minCoeff(), upper = seeds.rowwise().maxCoeff();
  const double apart = (upper - lower).norm();
  const double side = (apart > 0 ? apart : 1) / std::sqrt(d);
  const Eigen::ArrayXd middle = (lower + upper) / 2;
  return {middle - side / 2, middle + side / 2};
}

double ScaleOf(const Oracle& oracle) {
  const BoundingBox where = WhereOf(oracle);
  return (where.upper - where.lower).norm();
}

double Quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  const double at = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<size_t>(at);
  const size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (at - std::floor(at)) * (values[above] - values[below]);
}

Eigen::MatrixXd EachTimes(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& columns) {
  Eigen::MatrixXd product(matrix.rows(), columns.cols());
  Eigen::VectorXd column, result(matrix.rows());
  for (Eigen::Index j = 0; j < columns.cols(); ++j) {
    column = columns.col(j);
    result.noalias() = matrix * column;
    product.col(j) = result;
  }
  return product;
}

}  // namespace stellate::oracles
