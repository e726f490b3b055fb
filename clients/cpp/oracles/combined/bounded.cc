#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

#include "oracles/combined/common.h"
#include "stellate/oracles/walls.h"

namespace stellate::oracles {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr double kStep = 1e-4;     // of differences of closest points, in shares of where M is
constexpr double kOneSided = 0.1;  // of what a step outwards loses at the boundary, at least
constexpr double kMargin =
    3;  // of the tolerance that is advised: elsewhere they may differ by more

void CheckShape(const MatrixXd& columns, Index rows, Index count, const std::string& what) {
  if (columns.rows() == rows && columns.cols() == count && columns.allFinite()) return;
  const auto extent = [](Index m, Index n) {
    return std::to_string(m) + " x " + std::to_string(n);
  };
  throw std::runtime_error(what + " have to be finite, " + extent(rows, count) + ", and are " +
                           extent(columns.rows(), columns.cols()));
}

// Nearest points, those not found where they were asked for.
Answer Nearest(Oracle& of, const MatrixXd& x) {
  Answer near = of.ClosestPoint(x);
  if (!near.found.empty() && static_cast<Index>(near.found.size()) != x.cols()) {
    throw std::runtime_error("an oracle has to say of all closest points whether they were found");
  }
  for (Index j = 0; j < std::min(x.cols(), near.points.cols()); ++j) {
    if (!near.IsFound(j) && near.points.rows() == x.rows()) near.points.col(j) = x.col(j);
  }
  CheckShape(near.points, x.rows(), x.cols(), "closest points");
  return near;
}

// Where steps of length h along all axes, forth and back, are brought back to, from points of M or
// its boundary: d x 2 d of each, side by side.
MatrixXd Steps(Oracle& of, const MatrixXd& points, double h) {
  const Index d = points.rows();
  MatrixXd from(d, 2 * d * points.cols()), asked(d, from.cols());
  for (Index j = 0; j < points.cols(); ++j) {
    from.middleCols(2 * d * j, 2 * d).colwise() = points.col(j);
  }
  asked = from;
  for (Index j = 0; j < points.cols(); ++j) {
    asked.middleCols(2 * d * j, d).diagonal().array() += h;
    asked.middleCols(2 * d * j + d, d).diagonal().array() -= h;
  }
  const Answer back = Nearest(of, asked);
  MatrixXd steps = back.points - from;
  for (Index i = 0; i < steps.cols(); ++i) {
    if (!back.IsFound(i)) steps.col(i).setZero();
  }
  return steps;
}

// Tangent bases, (d k) x n, by differences of length h where the oracle has none.
MatrixXd Tangents(Oracle& of, const MatrixXd& points, double h) {
  const Index d = points.rows(), k = of.dimension(), n = points.cols();
  MatrixXd bases(d * k, n);
  if (n == 0 || k == 0) return bases;
  if (of.has_tangent_basis()) {
    bases = of.TangentBasis(points);
    CheckShape(bases, d * k, n, "tangent bases");
  } else if (k == d) {
    bases.colwise() = VectorXd(MatrixXd::Identity(d, d).reshaped());
  } else {
    // Steps in all directions come back to M along its tangent space, or along half of it.
    const MatrixXd steps = Steps(of, points, h);
    for (Index j = 0; j < n; ++j) {
      const MatrixXd some = steps.middleCols(2 * d * j, 2 * d);
      const Eigen::JacobiSVD<MatrixXd> svd(some, Eigen::ComputeThinU);
      Eigen::Map<RowMajor>(bases.col(j).data(), d, k) = svd.matrixU().leftCols(k);
    }
  }
  return bases;
}

// The unit vector of R^k across all k - 1 columns, whichever way.
VectorXd Across(const MatrixXd& columns) {
  const Index k = columns.rows();
  if (k == 1) return VectorXd::Ones(1);
  return Eigen::HouseholderQR<MatrixXd>(columns).householderQ() * VectorXd::Unit(k, k - 1);
}

std::string PlaceOf(const VectorXd& x) {
  std::ostringstream text;
  text << x.transpose().format(
      Eigen::IOFormat(6, Eigen::DontAlignCols, ", ", ", ", "", "", "[", "]"));
  return text.str();
}

}  // namespace

ManifoldWithBoundary::ManifoldWithBoundary(std::shared_ptr<Oracle> oracle,
                                           std::shared_ptr<Oracle> boundary, Clearance clearance,
                                           double tolerance)
    : inner_(std::move(oracle)), rim_(std::move(boundary)), clearance_(std::move(clearance)) {
  if (inner_ == nullptr) Refuse("a manifold with boundary needs an oracle");
  if (rim_ == nullptr) Refuse("a manifold with boundary needs an oracle of its boundary");
  for (const Oracle* const part : {inner_.get(), rim_.get()}) {
    RefuseWalls(*part, "ManifoldWithBoundary");
  }
  const int k = dimension(), d = ambient_dimension();
  if (rim_->dimension() != k - 1 || rim_->ambient_dimension() != d) {
    Refuse("the boundary of a manifold of dimension " + std::to_string(k) + " in R^" +
           std::to_string(d) + " has dimension " + std::to_string(k - 1) + " there, and this has " +
           std::to_string(rim_->dimension()) + " in R^" +
           std::to_string(rim_->ambient_dimension()));
  }
  if (!(tolerance > 0)) Refuse("tolerance has to be a positive share of the manifold's size");
  const bool by_rim = rim_->bounding_box() || inner_->seeds().size() == 0;
  const Oracle& placed = inner_->bounding_box() || !by_rim ? *inner_ : *rim_;
  if (!placed.bounding_box() && placed.seeds().size() == 0) {
    Refuse("neither oracle has a bounding box or seeds");
  }
  scale_ = ScaleOf(placed);
  tolerance_ = tolerance * scale_;
}

std::optional<BoundingBox> ManifoldWithBoundary::bounding_box() const {
  const std::optional<BoundingBox> own = inner_->bounding_box();
  return own ? own : rim_->bounding_box();
}

std::string ManifoldWithBoundary::about() const { return AboutOf({inner_, rim_}); }

MatrixXd ManifoldWithBoundary::seeds() const {
  const MatrixXd own = inner_->seeds();
  return own.size() > 0 ? own : rim_->seeds();
}

Answer ManifoldWithBoundary::ClosestPoint(const MatrixXd& x) {
  Answer near = Nearest(*inner_, x);
  Answer answer{std::move(near.points), std::move(near.found), {}, {}};
  if (clearance_) return answer;
  const VectorXd to_rim = ToRim(answer.points);
  std::vector<Index> ended;
  for (Index j = 0; j < x.cols(); ++j) {
    if (answer.IsFound(j) && to_rim[j] <= tolerance_) ended.push_back(j);
  }
  if (ended.empty()) return answer;
  const MatrixXd rim = answer.points(Eigen::all, ended);
  const MatrixXd outward = Outward(rim, Tangents(*inner_, rim, kStep * scale_));
  for (Index i = 0; i < rim.cols(); ++i) {
    const Index j = ended[static_cast<size_t>(i)];
    const double beyond = (x.col(j) - rim.col(i)).dot(outward.col(i));
    if (beyond > 0) answer.points.col(j) += beyond * outward.col(i);
  }
  return answer;
}

MatrixXd ManifoldWithBoundary::TangentBasis(const MatrixXd& points) {
  return Tangents(*inner_, clearance_ ? points : Nearest(*inner_, points).points, kStep * scale_);
}

Answer ManifoldWithBoundary::FacePoint(const MatrixXd& x, const Walls& /*face*/) {
  Answer near = Nearest(*rim_, x);
  return {std::move(near.points), std::move(near.found), {}, {}};  // what else it has is not M's
}

MatrixXd ManifoldWithBoundary::Clearances(const MatrixXd& points) {
  MatrixXd clearances(1, points.cols());
  if (clearance_) {
    VectorXd x;
    for (Index j = 0; j < points.cols(); ++j) clearances(0, j) = clearance_(x = points.col(j));
    return clearances;
  }
  const Answer back = Nearest(*inner_, points);
  const VectorXd to_rim = ToRim(points);
  for (Index j = 0; j < points.cols(); ++j) {
    const double beyond = (points.col(j) - back.points.col(j)).norm();
    clearances(0, j) = beyond > to_rim[j] / 2 ? -beyond : to_rim[j];  // beyond it they are the same
  }
  return clearances;
}

MatrixXd ManifoldWithBoundary::Conormals(const MatrixXd& points, const Walls& /*face*/) {
  const VectorXd off = CheckOn(points);
  MatrixXd outward = Outward(points, TangentBasis(points));
  if (!clearance_) CheckEnds(points, outward, off);
  return outward;
}

// At points of the boundary with these tangent bases of M, d x n.
MatrixXd ManifoldWithBoundary::Outward(const MatrixXd& points, const MatrixXd& bases) {
  const Index d = points.rows(), k = dimension();
  const double h = kStep * scale_;
  const MatrixXd rims = Tangents(*rim_, points, h);
  const MatrixXd steps = clearance_ ? MatrixXd() : Steps(*inner_, points, h);
  MatrixXd outward(d, points.cols());
  for (Index j = 0; j < points.cols(); ++j) {
    const Eigen::Map<const RowMajor> basis(bases.col(j).data(), d, k);
    const Eigen::Map<const RowMajor> rim(rims.col(j).data(), d, k - 1);
    // Of M's directions, the one across the boundary's: exactly, whatever the differences are.
    const VectorXd across = basis * Across(basis.transpose() * rim);
    const VectorXd inwards = clearance_
                                 ? Climb(points.col(j), basis)
                                 : VectorXd(steps.middleCols(2 * d * j, 2 * d).rowwise().sum());
    const double side = across.dot(inwards);
    if (!clearance_ && !(std::abs(side) > kOneSided * h)) {
      throw std::runtime_error(
          "nearest points do not end at the boundary, at " + PlaceOf(points.col(j)) +
          ": the oracle of a manifold with boundary has to answer with points of M alone, or a "
          "clearance has to say where M ends");
    }
    outward.col(j) = side > 0 ? VectorXd(-across) : across;
  }
  return outward;
}

// How the clearance grows along M, at x with this tangent basis.
VectorXd ManifoldWithBoundary::Climb(const VectorXd& x, const MatrixXd& basis) const {
  VectorXd growth(basis.cols());
  for (Index a = 0; a < basis.cols(); ++a) {
    const VectorXd step = kStep * scale_ * basis.col(a);
    growth[a] = (clearance_(x + step) - clearance_(x - step)) / (2 * kStep * scale_);
  }
  return basis * growth;
}

VectorXd ManifoldWithBoundary::ToRim(const MatrixXd& points) {
  const Answer near = Nearest(*rim_, points);
  VectorXd distances(points.cols());
  for (Index j = 0; j < points.cols(); ++j) {
    distances[j] = near.IsFound(j) ? (points.col(j) - near.points.col(j)).norm() : scale_;
  }
  return distances;
}

// How far points of the boundary are from M.
VectorXd ManifoldWithBoundary::CheckOn(const MatrixXd& points) {
  const Answer near = Nearest(*inner_, points);
  VectorXd off = (near.points - points).colwise().norm();
  Index worst = 0;
  if (points.cols() == 0 || off.maxCoeff(&worst) <= kStep * scale_) return off;
  throw std::runtime_error(PlaceOf(points.col(worst)) + " is of the boundary, and " +
                           Short(off[worst]) +
                           " away from the manifold: the two oracles have to be of one manifold");
}

// That M ends where its boundary is said to be, to within the tolerance: `off` before that, or, as
// a step outwards shows, beyond it. Else M would not go on beyond its end.
void ManifoldWithBoundary::CheckEnds(const MatrixXd& points, const MatrixXd& outward,
                                     const VectorXd& off) {
  const Answer back = Nearest(*inner_, points + kStep * scale_ * outward);
  VectorXd apart = off;
  for (Index j = 0; j < points.cols(); ++j) {
    if (!back.IsFound(j)) continue;
    apart[j] = std::max(apart[j], (back.points.col(j) - points.col(j)).dot(outward.col(j)));
  }
  Index worst = 0;
  if (points.cols() == 0 || apart.maxCoeff(&worst) <= tolerance_) return;
  throw std::runtime_error(
      "the two oracles disagree by " + Short(apart[worst]) + " about where the manifold ends, at " +
      PlaceOf(points.col(worst)) + ", and by no more than " + Short(tolerance_) +
      " they may: take a tolerance of " + Short(kMargin * apart[worst] / scale_) +
      ", or solve for nearest points more exactly");
}

}  // namespace stellate::oracles
