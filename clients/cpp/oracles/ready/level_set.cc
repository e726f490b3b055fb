#include <Eigen/QR>
#include <random>

#include "oracles/combined/common.h"
#include "oracles/combined/level_solver.h"
#include "oracles/exactness.h"
#include "stellate/oracles/equations.h"

namespace stellate::oracles {
namespace {

constexpr int kStarts = 64;

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

// The points of M that these lead to.
Eigen::MatrixXd OnManifold(Oracle& oracle, const Eigen::MatrixXd& starts) {
  const Answer near = oracle.ClosestPoint(starts);
  std::vector<Eigen::Index> found;
  for (Eigen::Index j = 0; j < near.points.cols(); ++j) {
    if (near.IsFound(j)) found.push_back(j);
  }
  return near.points(Eigen::all, found);
}

// k - m, m told by a value of f on M. Refuses what cannot be a level set.
int DimensionOf(Oracle* oracle, const LevelSet::Function& f) {
  if (oracle == nullptr) Refuse("a level set needs an oracle");
  if (!oracle->has_tangent_basis()) Refuse("a level set on a manifold needs its tangent bases");
  RefuseWalls(*oracle, "a level set");
  if (!f) Refuse("a level set needs a function f");
  const Eigen::MatrixXd points = OnManifold(*oracle, Starts(*oracle));
  if (points.cols() == 0) Refuse("no point of M was found, to look for the level set from");
  const auto count = static_cast<int>(f(points.col(0)).size());
  if (count >= 1 && count < oracle->dimension()) return oracle->dimension() - count;
  Refuse(std::to_string(count) + " equations on a manifold of dimension " +
         std::to_string(oracle->dimension()) + " leave none");
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
  const BoundingBox where{starts.rowwise().minCoeff(), starts.rowwise().maxCoeff()};
  scale_ = (where.upper - where.lower).norm();
  Exactness("f", where, OnManifold(*base_, starts)).Insist(f_);
  if (seeds_.size() == 0) seeds_ = base_->seeds();
  if (seeds_.size() > 0 && seeds_.rows() != ambient_dimension()) {
    Refuse("seeds have to be points of R^" + std::to_string(ambient_dimension()));
  }
}

std::optional<BoundingBox> LevelSet::bounding_box() const {
  return seeds_.size() > 0 ? std::nullopt : base_->bounding_box();
}

std::string LevelSet::about() const { return AboutOf({base_}); }

Eigen::MatrixXd LevelSet::seeds() const { return seeds_; }

Eigen::MatrixXd LevelSet::J(const Eigen::VectorXd& x) const {
  return jacobian_ ? jacobian_(x) : Differences(f_, x, scale_);
}

Eigen::MatrixXd LevelSet::BaseTangent(const Eigen::VectorXd& y) const {
  const Eigen::MatrixXd basis = base_->TangentBasis(y);
  return Eigen::Map<const RowMajor>(basis.data(), ambient_dimension(), base_->dimension());
}

bool LevelSet::Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const {
  const Level level{f_, [this](const Eigen::VectorXd& at) { return J(at); }, scale_};
  const Answer answer = OntoLevel(*base_, level, x);
  y = answer.points.col(0);
  return answer.IsFound(0);
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
