#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <limits>
#include <random>

#include "oracles/ready/common.h"
#include "stellate/oracles/combined.h"

namespace stellate::oracles {
namespace {

constexpr int kStarts = 64, kMaxSteps = 200;
constexpr double kShortestStep = 1e-10;  // a step, in shares of where M is
constexpr double kLongestStep = 0.1;     // of one step, likewise
constexpr double kLeastDamping = 1e-3;   // before giving up
constexpr double kStillShrinking = 0.9;  // what a step may be of the last

// Points to look for M from.
Eigen::MatrixXd Starts(const Oracle& oracle) {
  const std::optional<BoundingBox> box = oracle.bounding_box();
  Eigen::MatrixXd starts = oracle.seeds();
  if (!box && starts.size() == 0) Refuse("the oracle has neither a bounding box nor seeds");
  if (!box) return starts;
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> share(0, 1);
  starts.resize(box->lower.size(), kStarts);
  for (Eigen::Index j = 0; j < kStarts; ++j) {
    for (Eigen::Index i = 0; i < starts.rows(); ++i) {
      starts(i, j) = box->lower[i] + share(random) * (box->upper[i] - box->lower[i]);
    }
  }
  return starts;
}

// k - m, m told by a value of f on M. Refuses what cannot be a level set.
int DimensionOf(Oracle* oracle, const LevelSet::Function& f) {
  if (oracle == nullptr) Refuse("a level set needs an oracle");
  if (!oracle->has_tangent_basis()) Refuse("a level set on a manifold needs its tangent bases");
  if (!f) Refuse("a level set needs a function f");
  const Answer near = oracle->ClosestPoint(Starts(*oracle));
  for (Eigen::Index j = 0; j < near.points.cols(); ++j) {
    if (!near.IsFound(j)) continue;
    const auto count = static_cast<int>(f(near.points.col(j)).size());
    if (count >= 1 && count < oracle->dimension()) return oracle->dimension() - count;
    Refuse(std::to_string(count) + " equations on a manifold of dimension " +
           std::to_string(oracle->dimension()) + " leave none");
  }
  Refuse("no point of M was found, to look for the level set from");
}

}  // namespace

LevelSet::LevelSet(std::shared_ptr<Oracle> oracle, Function f, Jacobian jacobian,
                   Eigen::MatrixXd seeds)
    : PointwiseOracle(DimensionOf(oracle.get(), f), oracle->ambient_dimension()),
      base_(std::move(oracle)),
      f_(std::move(f)),
      jacobian_(std::move(jacobian)),
      seeds_(std::move(seeds)) {
  const Eigen::MatrixXd starts = Starts(*base_);
  scale_ = (starts.rowwise().maxCoeff() - starts.rowwise().minCoeff()).norm();
  if (seeds_.size() == 0) seeds_ = base_->seeds();
  if (seeds_.size() > 0 && seeds_.rows() != ambient_dimension()) {
    Refuse("seeds have to be points of R^" + std::to_string(ambient_dimension()));
  }
}

std::optional<BoundingBox> LevelSet::bounding_box() const {
  return seeds_.size() > 0 ? std::nullopt : base_->bounding_box();
}

Eigen::MatrixXd LevelSet::seeds() const { return seeds_; }

Eigen::MatrixXd LevelSet::J(const Eigen::VectorXd& x) const {
  return jacobian_ ? jacobian_(x) : Differences(f_, x, scale_);
}

bool LevelSet::OntoBase(const Eigen::VectorXd& x, Eigen::VectorXd& y) const {
  const Answer answer = base_->ClosestPoint(x);
  y = answer.points.col(0);
  return answer.IsFound(0);
}

Eigen::MatrixXd LevelSet::BaseTangent(const Eigen::VectorXd& y) const {
  const Eigen::MatrixXd basis = base_->TangentBasis(y);
  return Eigen::Map<const RowMajor>(basis.data(), ambient_dimension(), base_->dimension());
}

bool LevelSet::Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const {
  if (!OntoBase(x, y)) return false;
  double damping = 1, last = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kMaxSteps; ++i) {
    const Eigen::MatrixXd basis = BaseTangent(y);
    const Eigen::MatrixXd slopes = J(y) * basis;  // m x k
    const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver(slopes);
    if (solver.rank() < slopes.rows()) return false;
    // In M's tangent space: the shortest way to f = 0, and what of the wish does not change f.
    const Eigen::VectorXd wish = basis.transpose() * (x - y);
    const Eigen::VectorXd down = -solver.solve(f_(y));
    const Eigen::VectorXd along = wish - solver.solve(slopes * wish);
    const double length = down.norm() + along.norm();
    // Longer than the last: the set bends so that the step went too far.
    if (length > kStillShrinking * last) damping *= 0.5;
    last = length;
    if (!std::isfinite(length) || damping <= kLeastDamping) return false;
    Eigen::VectorXd step = down + damping * along;
    step *= std::min(1.0, kLongestStep * scale_ / std::max(step.norm(), 1e-300));
    if (!OntoBase(y + basis * step, y)) return false;
    if (length <= kShortestStep * scale_) return true;
  }
  return false;
}

// The directions of M along which f does not change.
void LevelSet::Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const {
  const Eigen::MatrixXd basis = BaseTangent(y);
  const Eigen::MatrixXd slopes = J(y) * basis;
  Eigen::MatrixXd kernel = Eigen::MatrixXd::Zero(basis.cols(), dimension());
  kernel.bottomRows(dimension()).setIdentity();
  kernel.applyOnTheLeft(Eigen::HouseholderQR<Eigen::MatrixXd>(slopes.transpose()).householderQ());
  tangent.noalias() = basis * kernel;
}

}  // namespace stellate::oracles
