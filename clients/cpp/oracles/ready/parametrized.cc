#include "stellate/oracles/parametrized.h"

#include "oracles/combined/common.h"
#include "oracles/ready/atlas.h"

namespace stellate::oracles {

Parametrized::Parametrized(std::unique_ptr<const Atlas> atlas)
    : PointwiseOracle(atlas->dimension(), atlas->ambient_dimension()), atlas_(std::move(atlas)) {}

Parametrized::Parametrized(std::vector<Chart> charts)
    : Parametrized(std::make_unique<const Atlas>(std::move(charts))) {}

Parametrized::~Parametrized() = default;

std::optional<BoundingBox> Parametrized::bounding_box() const {
  return BoxAround(atlas_->points(), 0.05);
}

std::shared_ptr<Oracle> Parametrized::DividedBy(const Eigen::VectorXd& scale) const {
  return std::make_shared<Parametrized>(atlas_->DividedBy(scale));
}

bool Parametrized::Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const {
  Eigen::MatrixXd basis;
  return atlas_->Closest(x, y, basis);
}

void Parametrized::Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const {
  Eigen::VectorXd again;
  if (!atlas_->Closest(y, again, tangent)) {
    tangent = Eigen::MatrixXd::Identity(ambient_dimension(), dimension());
  }
}

Answer Parametrized::IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                                   const Eigen::VectorXd& radii) {
  Answer answer;
  answer.points = centers;
  answer.found.assign(static_cast<size_t>(centers.cols()), 0);
  Eigen::VectorXd y;
  for (Eigen::Index j = 0; j < centers.cols(); ++j) {
    const Eigen::MatrixXd basis =
        Eigen::Map<const RowMajor>(bases.col(j).data(), ambient_dimension(), dimension());
    if (!atlas_->Meet(centers.col(j), basis, radii[j], y)) continue;
    answer.points.col(j) = y;
    answer.found[static_cast<size_t>(j)] = 1;
  }
  return answer;
}

}  // namespace stellate::oracles
