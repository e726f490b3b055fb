#include "support/oracle_invariants.h"

#include <Eigen/Dense>
#include <limits>
#include <random>
#include <string>

namespace stellate::testing {
namespace {

using ::testing::AssertionFailure;
using ::testing::AssertionResult;
using ::testing::AssertionSuccess;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

class Checker {
 public:
  Checker(Oracle& oracle, const InvariantOptions& options)
      : oracle_(oracle),
        options_(options),
        d_(oracle.ambient_dimension()),
        k_(oracle.dimension()),
        random_(options.random_seed) {}

  AssertionResult Run() {
    if (k_ < 1 || k_ >= d_) return Broken("dimensions") << "k = " << k_ << ", d = " << d_;
    for (auto law :
         {&Checker::FindPoints, &Checker::ClosestPointsAreClosest, &Checker::BatchingChangesNothing,
          &Checker::TangentsAreOrthonormal, &Checker::TangentsMatchDerivatives,
          &Checker::OffsetsAreNormal, &Checker::IntersectionsAreWhereAsked}) {
      if (AssertionResult result = (this->*law)(); !result) return result;
    }
    return AssertionSuccess();
  }

 private:
  AssertionResult Broken(const std::string& law) {
    return AssertionFailure() << "random seed " << options_.random_seed << ": " << law << ": ";
  }
  double Uniform(double low, double high) {
    return low + (high - low) * std::ldexp(static_cast<double>(random_() >> 11), -53);
  }
  Eigen::VectorXd RandomUnit(Eigen::Index size) {
    Eigen::VectorXd v(size);
    do {
      for (double& entry : v) entry = Uniform(-1, 1);
    } while (v.squaredNorm() > static_cast<double>(size) || v.norm() < 1e-3);
    return v.normalized();
  }
  Eigen::MatrixXd Basis(Eigen::Index j) const {
    return Eigen::Map<const RowMajor>(tangents_.col(j).data(), d_, k_);
  }
  // A random vector normal to M at sample j, of the given length.
  Eigen::VectorXd RandomNormal(Eigen::Index j, double length) {
    const Eigen::MatrixXd basis = Basis(j);
    Eigen::VectorXd v;
    do {
      v = RandomUnit(d_);
      v -= basis * (basis.transpose() * v);
    } while (v.norm() < 1e-2);
    return length * v.normalized();
  }

  AssertionResult FindPoints() {
    starts_ = oracle_.seeds();
    if (const auto box = oracle_.bounding_box()) {
      if (box->lower.size() != d_ || !(box->lower.array() < box->upper.array()).all()) {
        return Broken("the bounding box is a box");
      }
      starts_.resize(d_, options_.samples);
      for (Eigen::Index j = 0; j < starts_.cols(); ++j) {
        for (int i = 0; i < d_; ++i) starts_(i, j) = Uniform(box->lower[i], box->upper[i]);
      }
    }
    if (starts_.cols() == 0) return Broken("neither a bounding box nor seeds");
    const Answer answer = oracle_.ClosestPoint(starts_);
    if (answer.points.rows() != d_ || answer.points.cols() != starts_.cols()) {
      return Broken("answers have the shape of their queries");
    }
    std::vector<Eigen::Index> kept;
    for (Eigen::Index j = 0; j < starts_.cols(); ++j) {
      if (answer.IsFound(j)) kept.push_back(j);
    }
    if (kept.empty()) return Broken("no start has a closest point");
    points_ = answer.points(Eigen::all, kept);
    starts_ = Eigen::MatrixXd(starts_(Eigen::all, kept));
    size_ = (points_.rowwise().maxCoeff() - points_.rowwise().minCoeff()).norm();
    if (!points_.allFinite()) return Broken("closest points are finite");
    return AssertionSuccess();
  }

  AssertionResult ClosestPointsAreClosest() {
    const Answer again = oracle_.ClosestPoint(points_);
    for (Eigen::Index j = 0; j < points_.cols(); ++j) {
      const double moved = again.IsFound(j) ? (again.points.col(j) - points_.col(j)).norm()
                                            : std::numeric_limits<double>::infinity();
      if (!(moved <= options_.tolerance * size_)) {
        return Broken("a closest point is its own closest point")
               << "[" << points_.col(j).transpose() << "] moved by " << moved;
      }
      const double own = (points_.col(j) - starts_.col(j)).norm();
      Eigen::Index nearest = 0;
      const double seen = std::sqrt(
          (points_.colwise() - starts_.col(j)).colwise().squaredNorm().minCoeff(&nearest));
      if (own > seen + options_.tolerance * size_) {
        return Broken("no seen point is nearer than the closest point")
               << "from [" << starts_.col(j).transpose() << "] it is at " << own
               << ", but there is [" << points_.col(nearest).transpose() << "] at " << seen;
      }
    }
    return AssertionSuccess();
  }

  AssertionResult BatchingChangesNothing() {
    const Eigen::Index last = starts_.cols() - 1;
    const Answer single = oracle_.ClosestPoint(starts_.col(last));
    if (!single.IsFound(0) ||
        (single.points.col(0) - points_.col(last)).norm() > options_.tolerance * size_) {
      return Broken("a query alone is answered as in a batch");
    }
    const Answer none = oracle_.ClosestPoint(Eigen::MatrixXd(d_, 0));
    if (none.points.cols() != 0) return Broken("an empty batch has an empty answer");
    return AssertionSuccess();
  }

  AssertionResult TangentsAreOrthonormal() {
    if (!oracle_.has_tangent_basis()) return DifferenceTangents();
    tangents_ = oracle_.TangentBasis(points_);
    if (tangents_.rows() != d_ * k_ || tangents_.cols() != points_.cols()) {
      return Broken("tangent bases have d k rows and a column for each point");
    }
    for (Eigen::Index j = 0; j < points_.cols(); ++j) {
      const Eigen::MatrixXd gram = Basis(j).transpose() * Basis(j);
      const double error = (gram - Eigen::MatrixXd::Identity(k_, k_)).cwiseAbs().maxCoeff();
      if (!(error <= 1e-12)) {
        return Broken("a tangent basis is orthonormal")
               << "off by " << error << " at [" << points_.col(j).transpose() << "]";
      }
    }
    return AssertionSuccess();
  }

  // The derivative of the closest point map at a point of M is the projection on its tangent space.
  Eigen::VectorXd DerivativeAlong(Eigen::Index j, const Eigen::VectorXd& v, double h) {
    Eigen::MatrixXd ends(d_, 2);
    ends << points_.col(j) + h * v, points_.col(j) - h * v;
    const Eigen::MatrixXd images = oracle_.ClosestPoint(ends).points;
    return (images.col(0) - images.col(1)) / (2 * h);
  }

  AssertionResult DifferenceTangents() {
    tangents_.resize(d_ * k_, points_.cols());
    for (Eigen::Index j = 0; j < points_.cols(); ++j) {
      Eigen::MatrixXd images(d_, k_);
      for (int a = 0; a < k_; ++a) {
        images.col(a) = DerivativeAlong(j, RandomUnit(d_), 1e-5 * size_);
      }
      const Eigen::MatrixXd basis =
          images.householderQr().householderQ() * Eigen::MatrixXd::Identity(d_, k_);
      Eigen::Map<RowMajor>(tangents_.col(j).data(), d_, k_) = basis;
    }
    return AssertionSuccess();
  }

  AssertionResult TangentsMatchDerivatives() {
    for (Eigen::Index j = 0; j < points_.cols(); ++j) {
      const Eigen::MatrixXd basis = Basis(j);
      for (int trial = 0; trial < 3; ++trial) {
        const Eigen::VectorXd v = RandomUnit(d_);
        const Eigen::VectorXd moved = DerivativeAlong(j, v, 1e-5 * options_.clearance);
        const double error = (moved - basis * (basis.transpose() * v)).norm();
        if (!(error <= 1e-4)) {  // h^2 of the difference, and rounding over h
          return Broken("the closest point moves along the tangent space")
                 << "off by " << error << " at [" << points_.col(j).transpose() << "]";
        }
      }
    }
    return AssertionSuccess();
  }

  AssertionResult OffsetsAreNormal() {
    for (Eigen::Index j = 0; j < points_.cols(); ++j) {
      const Eigen::VectorXd x = points_.col(j) + RandomNormal(j, options_.clearance);
      const Answer answer = oracle_.ClosestPoint(x);
      const double error = answer.IsFound(0) ? (answer.points.col(0) - points_.col(j)).norm()
                                             : std::numeric_limits<double>::infinity();
      if (!(error <= 100 * options_.tolerance * size_)) {
        return Broken("the closest point undoes a normal offset")
               << "of " << options_.clearance << " from [" << points_.col(j).transpose()
               << "], but is off by " << error;
      }
    }
    return AssertionSuccess();
  }

  AssertionResult IntersectionsAreWhereAsked() {
    if (!oracle_.has_intersect_flat()) return AssertionSuccess();
    const Eigen::Index n = points_.cols();
    // A tangent step t < clearance and the flat upright there: M crosses it within about t^2.
    const double t = 0.4 * options_.clearance;
    Eigen::MatrixXd centers(d_, n);
    for (Eigen::Index j = 0; j < n; ++j) {
      centers.col(j) = points_.col(j) + t * (Basis(j) * RandomUnit(k_));
    }
    const Eigen::VectorXd radii = Eigen::VectorXd::Constant(n, t);
    const Answer answer = oracle_.IntersectFlat(centers, tangents_, radii);
    if (answer.points.rows() != d_ || answer.points.cols() != n) {
      return Broken("intersections have the shape of their queries");
    }
    const Eigen::MatrixXd closest = oracle_.ClosestPoint(answer.points).points;
    for (Eigen::Index j = 0; j < n; ++j) {
      if (!answer.IsFound(j)) {
        return Broken("an intersection that exists is found")
               << "near [" << points_.col(j).transpose() << "]";
      }
      const Eigen::VectorXd offset = answer.points.col(j) - centers.col(j);
      const double off_flat = (Basis(j).transpose() * offset).norm();
      const double off_manifold = (closest.col(j) - answer.points.col(j)).norm();
      if (!(off_flat <= options_.tolerance * size_) ||
          !(off_manifold <= options_.tolerance * size_) || !(offset.norm() <= t)) {
        return Broken("an intersection is in the flat, on M, within the radius")
               << "off the flat by " << off_flat << ", off M by " << off_manifold << ", at "
               << offset.norm() << " of " << t;
      }
    }
    // The same flats seen from far along their normals: the intersection is out of reach.
    for (Eigen::Index j = 0; j < n; ++j) centers.col(j) += RandomNormal(j, 0.5 * t);
    const Answer far = oracle_.IntersectFlat(centers, tangents_, radii * 1e-3);
    for (Eigen::Index j = 0; j < n; ++j) {
      if (far.IsFound(j) && (far.points.col(j) - centers.col(j)).norm() > 1e-3 * t) {
        return Broken("nothing is found beyond the radius");
      }
    }
    return AssertionSuccess();
  }

  Oracle& oracle_;
  const InvariantOptions& options_;
  const Eigen::Index d_, k_;
  std::mt19937_64 random_;
  Eigen::MatrixXd starts_, points_, tangents_;
  double size_ = 1;
};

}  // namespace

::testing::AssertionResult OracleInvariantsHold(Oracle& oracle, const InvariantOptions& options) {
  return Checker(oracle, options).Run();
}

}  // namespace stellate::testing
