#include "core/base/dense.h"

#include <Eigen/Dense>

#include "core/base/instantiate.h"

namespace stellate::core {

Eigen::MatrixXd OrthonormalBasis(const Eigen::MatrixXd& columns, Eigen::Index count) {
  return Eigen::HouseholderQR<Eigen::MatrixXd>(columns).householderQ() *
         Eigen::MatrixXd::Identity(columns.rows(), count);
}

Eigen::MatrixXd PivotedBasis(const Eigen::MatrixXd& columns, Eigen::Index count) {
  return Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(columns).householderQ() *
         Eigen::MatrixXd::Identity(columns.rows(), count);
}

Eigen::MatrixXd SolveSymmetric(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a.ldlt().solve(b);
}

Eigen::VectorXd SolvePivoted(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) {
  return a.fullPivLu().solve(b);
}

Eigen::VectorXd LeastSquares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) {
  return a.colPivHouseholderQr().solve(b);
}

Eigen::VectorXd ShortestLeastSquares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b,
                                     double threshold) {
  Eigen::JacobiSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeThinU | Eigen::ComputeThinV);
  return svd.setThreshold(threshold).solve(b);
}

SymmetricEigen EigenOfSymmetric(const Eigen::MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(a);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Eigen::VectorXd EigenvaluesOfSymmetric(const Eigen::MatrixXd& a) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

SingularColumns LeftSingular(const Eigen::MatrixXd& a) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeThinU);
  return {svd.matrixU(), svd.singularValues()};
}

std::optional<Eigen::VectorXd> DirectionOffRows(const Eigen::MatrixXd& rows, double threshold) {
  Eigen::FullPivLU<Eigen::MatrixXd> lu(rows);
  lu.setThreshold(threshold);
  if (lu.rank() < rows.rows()) return std::nullopt;
  return lu.kernel().col(0).normalized();
}

template <int K>
Eigen::Matrix<double, K, K> Inverse(const Eigen::Matrix<double, K, K>& a) {
  return a.inverse();
}

template <int K>
double Determinant(const Eigen::Matrix<double, K, K>& a) {
  return a.determinant();
}

#define STELLATE_EACH(K)                                                               \
  template Eigen::Matrix<double, K, K> Inverse<K>(const Eigen::Matrix<double, K, K>&); \
  template double Determinant<K>(const Eigen::Matrix<double, K, K>&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
