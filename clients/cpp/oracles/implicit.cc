#include "stellate/implicit.h"

#include <algorithm>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "oracles/equation_system.h"
#include "oracles/exactness.h"

namespace stellate {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// f, insisting on as many numbers as there are equations.
EquationSystem::Function Shaped(ImplicitOracle::Function f, Index equations) {
  return [f = std::move(f), equations](const VectorXd& x) {
    VectorXd value = f(x);
    if (value.size() == equations) return value;
    throw OracleError("ORACLE_SHAPE", "f returned " + std::to_string(value.size()) +
                                          " numbers; they have to be " + std::to_string(equations) +
                                          ", one for each equation");
  };
}

EquationSystem::Jacobian Shaped(ImplicitOracle::Jacobian jacobian, Index equations) {
  if (!jacobian) return {};
  return [jacobian = std::move(jacobian), equations](const VectorXd& x) {
    MatrixXd given = jacobian(x);
    if (given.rows() == equations && given.cols() == x.size()) return given;
    throw OracleError("ORACLE_SHAPE",
                      "the jacobian returned a matrix " + std::to_string(given.rows()) + " x " +
                          std::to_string(given.cols()) + "; it has to be " +
                          std::to_string(equations) + " x " + std::to_string(x.size()));
  };
}

[[noreturn]] void RefuseEnd(const VectorXd& y) {
  std::ostringstream message;
  message.precision(17);
  message << "the manifold ends where f does, near [";
  for (Index i = 0; i < y.size(); ++i) message << (i > 0 ? ", " : "") << y[i];
  message << "]: the derivatives of f are not finite there. Write the equation so that f is smooth "
             "around M, without roots, logarithms or quotients that end on it: z^2 = 1 - x^2 in "
             "place of z = sqrt(1 - x^2). If M has a boundary there, clip it by a wall a little "
             "before: Clipped";
  throw OracleError("ORACLE_NOT_FINITE", message.str());
}

}  // namespace

ImplicitOracle::ImplicitOracle(int dimension, int ambient_dimension, Function f, Jacobian jacobian,
                               BoundingBox box)
    : PointwiseOracle(dimension, ambient_dimension),
      f_(std::move(f)),
      jacobian_(std::move(jacobian)),
      box_(std::move(box)) {
  if (dimension < 1 || dimension >= ambient_dimension) {
    throw std::invalid_argument("ImplicitOracle needs 1 <= dimension < ambient_dimension");
  }
  if (box_.lower.size() != ambient_dimension || box_.upper.size() != ambient_dimension) {
    throw std::invalid_argument("ImplicitOracle needs a bounding box of the ambient dimension");
  }
  if (!(box_.lower.array() < box_.upper.array()).all()) {
    throw std::invalid_argument("ImplicitOracle needs a bounding box with lower < upper");
  }
  exactness_ = std::make_shared<const Exactness>("f", box_);
  const double largest =
      std::max(box_.lower.lpNorm<Eigen::Infinity>(), box_.upper.lpNorm<Eigen::Infinity>());
  system_ = std::make_shared<const EquationSystem>(Shaped(f_, equations()),
                                                   Shaped(jacobian_, equations()), equations(),
                                                   (box_.upper - box_.lower).norm(), largest);
}

Answer ImplicitOracle::IntersectFlat(const MatrixXd& centers, const MatrixXd& bases,
                                     const VectorXd& radii) {
  const EquationSystem& equations = system();
  Answer answer;
  answer.points.setZero(ambient_dimension(), centers.cols());
  answer.found.assign(static_cast<size_t>(centers.cols()), 0);
  for (Index j = 0; j < centers.cols(); ++j) {
    const VectorXd center = centers.col(j);
    const MatrixXd basis =
        Eigen::Map<const RowMajor>(bases.col(j).data(), ambient_dimension(), dimension());
    const MatrixXd within = NullSpace(basis.transpose());
    Beginning beginning;
    beginning.ways = &within;
    Descent met = equations.Drive(center, beginning);
    if (!met.arrived || (met.point - center).norm() > radii[j]) {
      const std::optional<VectorXd> nearest = NearestZero(equations, center, center);
      if (!nearest) continue;
      met =
          equations.Drive(center + within * (within.transpose() * (*nearest - center)), beginning);
      if (!met.arrived || (met.point - center).norm() > radii[j]) continue;
    }
    answer.points.col(j) = met.point;
    answer.found[static_cast<size_t>(j)] = 1;
  }
  return answer;
}

const EquationSystem& ImplicitOracle::system() const {
  exactness_->Insist(f_);
  return *system_;
}

bool ImplicitOracle::Project(const VectorXd& x, VectorXd& y) const {
  std::optional<VectorXd> nearest = NearestZero(system(), x, x);
  if (!nearest) return false;
  y = *std::move(nearest);
  return true;
}

void ImplicitOracle::Tangent(const VectorXd& y, MatrixXd& tangent) const {
  const MatrixXd jacobian = system_->SlopesAt(y);
  if (!jacobian.allFinite()) RefuseEnd(y);
  tangent = NullSpace(jacobian);
}

std::shared_ptr<Oracle> ImplicitOracle::DividedBy(const VectorXd& scale) const {
  const Function f = [f = f_, scale](const VectorXd& y) { return f(y.cwiseProduct(scale)); };
  Jacobian jacobian;
  if (jacobian_) {
    jacobian = [own = jacobian_, scale](const VectorXd& y) -> MatrixXd {
      MatrixXd slopes = own(y.cwiseProduct(scale));
      if (slopes.cols() == scale.size()) slopes = slopes * scale.asDiagonal();
      return slopes;  // which J refuses else
    };
  }
  const BoundingBox box{box_.lower.cwiseQuotient(scale), box_.upper.cwiseQuotient(scale)};
  return std::make_shared<ImplicitOracle>(dimension(), ambient_dimension(), f, jacobian, box);
}

MatrixXd ImplicitOracle::EquationGradients(const MatrixXd& points) {
  MatrixXd gradients(equations() * ambient_dimension(), points.cols());
  for (Index j = 0; j < points.cols(); ++j) {
    gradients.col(j) = system_->SlopesAt(points.col(j)).transpose().reshaped();
  }
  return gradients;
}

}  // namespace stellate
