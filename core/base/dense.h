#pragma once

#include <Eigen/Core>
#include <optional>

namespace stellate::core {

// Eigen's decompositions, each compiled once: one of them in a source, for five sizes, takes half
// of its time to compile. Sizes are known at run time only.

// Returns an orthonormal basis whose first vectors span these columns. The number of vectors is at
// most the number of rows.
Eigen::MatrixXd OrthonormalBasis(const Eigen::MatrixXd& columns, Eigen::Index count);

// Returns the same by column pivoting, for columns that nearly depend on each other.
Eigen::MatrixXd PivotedBasis(const Eigen::MatrixXd& columns, Eigen::Index count);

// Solves a x = b, for a symmetric a that is not singular; reads its lower half.
Eigen::MatrixXd SolveSymmetric(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

// Solves a x = b for any square a, by elimination with full pivoting.
Eigen::VectorXd SolvePivoted(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);

// Returns an x with the least |a x - b|, by column pivoting: if columns depend on each other, one
// of several. ShortestLeastSquares returns the shortest of these; singular values below `threshold`
// of the largest count as zero.
Eigen::VectorXd LeastSquares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);
Eigen::VectorXd ShortestLeastSquares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b,
                                     double threshold);

// The eigenvalues of a symmetric matrix, the smallest first, and unit eigenvectors in the same
// order.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
SymmetricEigen EigenOfSymmetric(const Eigen::MatrixXd& a);
Eigen::VectorXd EigenvaluesOfSymmetric(const Eigen::MatrixXd& a);

// The left singular vectors, as many as columns, and the singular values, the largest first.
struct SingularColumns {
  Eigen::MatrixXd vectors;
  Eigen::VectorXd values;
};
SingularColumns LeftSingular(const Eigen::MatrixXd& a);

// Returns the unit direction orthogonal to k - 1 rows of k numbers; nothing if their rank is lower.
// Pivots below `threshold` of the largest count as zero.
std::optional<Eigen::VectorXd> DirectionOffRows(const Eigen::MatrixXd& rows, double threshold);

// For K = 1 to kMaxDimension. If a is singular the result is not an inverse, and not finite.
template <int K>
Eigen::Matrix<double, K, K> Inverse(const Eigen::Matrix<double, K, K>& a);
template <int K>
double Determinant(const Eigen::Matrix<double, K, K>& a);

}  // namespace stellate::core
