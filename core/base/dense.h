#pragma once

#include <Eigen/Core>
#include <optional>

namespace stellate::core {

// Eigen's decompositions, each compiled once: one of them in a source, for five sizes, is half of
// what compiling that source takes. Sizes are known at run time only.

// An orthonormal basis whose first vectors span these columns, of as many vectors as asked for: at
// most as many as the rows.
Eigen::MatrixXd OrthonormalBasis(const Eigen::MatrixXd& columns, Eigen::Index count);

// The same with the columns that matter most taken first, where some nearly depend on others.
Eigen::MatrixXd PivotedBasis(const Eigen::MatrixXd& columns, Eigen::Index count);

// x of a x = b, of a symmetric a that is not singular; its lower half is read.
Eigen::MatrixXd SolveSymmetric(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

// The same where a may be any square, by elimination with full pivoting.
Eigen::VectorXd SolvePivoted(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);

// An x with the least |a x - b|, by column pivoting: where columns depend on each other, one of
// several. The shortest of them takes singular values below `threshold` of the largest for zero.
Eigen::VectorXd LeastSquares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);
Eigen::VectorXd ShortestLeastSquares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b,
                                     double threshold);

// Of a symmetric matrix, the smallest first; eigenvectors of length 1 in the same order.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
SymmetricEigen EigenOfSymmetric(const Eigen::MatrixXd& a);
Eigen::VectorXd EigenvaluesOfSymmetric(const Eigen::MatrixXd& a);

// Left singular vectors, as many as columns, and singular values, the largest first.
struct SingularColumns {
  Eigen::MatrixXd vectors;
  Eigen::VectorXd values;
};
SingularColumns LeftSingular(const Eigen::MatrixXd& a);

// The direction, of length 1, that k - 1 rows of k numbers leave; nothing if their rank is lower,
// with pivots below `threshold` of the largest taken for zero.
std::optional<Eigen::VectorXd> DirectionOffRows(const Eigen::MatrixXd& rows, double threshold);

// For K = 1 to kMaxDimension. If a is singular the result is not an inverse, and not finite.
template <int K>
Eigen::Matrix<double, K, K> Inverse(const Eigen::Matrix<double, K, K>& a);
template <int K>
double Determinant(const Eigen::Matrix<double, K, K>& a);

}  // namespace stellate::core
