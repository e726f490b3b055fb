#include "oracles/combined/level_solver.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "oracles/combined/common.h"

namespace stellate::oracles {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr int kMaxSteps = 200;
constexpr double kShortestStep = 1e-10;  // a step, in shares of where M is
constexpr double kLongestStep = 0.1;     // of one step, likewise
constexpr double kLeastDamping = 1e-3;   // before giving up
constexpr double kStillShrinking = 0.9;  // what a step may be of the last

// The way of one point.
struct Way {
  double damping = 1, last = std::numeric_limits<double>::infinity();
  bool arrives = false;  // with the step that it takes now
};

// The next step from y, of M with this basis there; false where there is none.
bool Step(const Level& level, const VectorXd& x, const VectorXd& y, const MatrixXd& basis, Way* way,
          VectorXd* step) {
  const MatrixXd slopes = level.slopes(y) * basis;  // m x k
  const Eigen::CompleteOrthogonalDecomposition<MatrixXd> solver(slopes);
  if (solver.rank() < slopes.rows()) return false;
  // In M's tangent space: the shortest way to f = 0, and what of the wish does not change f.
  const VectorXd wish = basis.transpose() * (x - y);
  const VectorXd down = -solver.solve(level.f(y));
  const VectorXd along = wish - solver.solve(slopes * wish);
  const double length = down.norm() + along.norm();
  // Longer than the last: the set bends so that the step went too far.
  if (length > kStillShrinking * way->last) way->damping *= 0.5;
  way->last = length;
  if (!std::isfinite(length) || way->damping <= kLeastDamping) return false;
  VectorXd inside = down + way->damping * along;
  inside *= std::min(1.0, kLongestStep * level.scale / std::max(inside.norm(), 1e-300));
  *step = basis * inside;
  way->arrives = length <= kShortestStep * level.scale;
  return true;
}

}  // namespace

Answer OntoLevel(Oracle& manifold, const Level& level, const MatrixXd& x) {
  const Answer start = manifold.ClosestPoint(x);
  Answer answer{start.points, std::vector<std::uint8_t>(static_cast<size_t>(x.cols()), 0), {}, {}};
  std::vector<Way> ways(static_cast<size_t>(x.cols()));
  std::vector<Index> walking;
  for (Index j = 0; j < x.cols(); ++j) {
    if (start.IsFound(j)) walking.push_back(j);
  }
  const Index d = x.rows(), k = manifold.dimension();
  VectorXd step;
  for (int i = 0; i < kMaxSteps && !walking.empty(); ++i) {
    const MatrixXd bases = manifold.TangentBasis(answer.points(Eigen::all, walking));
    MatrixXd ahead(d, static_cast<Index>(walking.size()));
    std::vector<Index> able;
    for (size_t a = 0; a < walking.size(); ++a) {
      const Index j = walking[a];
      const MatrixXd basis =
          Eigen::Map<const RowMajor>(bases.col(static_cast<Index>(a)).data(), d, k);
      const VectorXd y = answer.points.col(j);
      if (!Step(level, x.col(j), y, basis, &ways[static_cast<size_t>(j)], &step)) continue;
      ahead.col(static_cast<Index>(able.size())) = y + step;
      able.push_back(j);
    }
    walking.clear();
    if (able.empty()) break;
    const Answer there = manifold.ClosestPoint(ahead.leftCols(static_cast<Index>(able.size())));
    for (size_t a = 0; a < able.size(); ++a) {
      if (!there.IsFound(static_cast<Index>(a))) continue;
      const auto j = static_cast<size_t>(able[a]);
      answer.points.col(able[a]) = there.points.col(static_cast<Index>(a));
      if (ways[j].arrives) {
        answer.found[j] = 1;
      } else {
        walking.push_back(able[a]);
      }
    }
  }
  return answer;
}

}  // namespace stellate::oracles
