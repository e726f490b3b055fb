#include "oracles/combined/common.h"
#include "stellate/oracles/combined.h"

namespace stellate::oracles {

Transformed::Transformed(std::shared_ptr<Oracle> oracle, Similarity similarity)
    : inner_(std::move(oracle)), map_(std::move(similarity)) {
  if (inner_ == nullptr) Refuse("Transformed needs an oracle");
  RefuseWalls(*inner_, "Transformed");
  const Eigen::Index d = inner_->ambient_dimension();
  Eigen::MatrixXd& turn = map_.rotation;
  if (turn.size() == 0) turn.setIdentity(d, d);
  if (turn.cols() != d || turn.rows() < d) {
    Refuse("rotation is " + std::to_string(turn.rows()) + " x " + std::to_string(turn.cols()) +
           "; it has to be D x " + std::to_string(d) + ", D >= " + std::to_string(d));
  }
  constexpr double kOrthonormal = 1e-9;  // what a factorization in double precision is far below
  const Eigen::MatrixXd gram = turn.transpose() * turn;
  if (!((gram - Eigen::MatrixXd::Identity(d, d)).cwiseAbs().maxCoeff() <= kOrthonormal)) {
    Refuse("rotation has to have orthonormal columns; Eigen::HouseholderQR makes them");
  }
  if (map_.translation.size() == 0) map_.translation.setZero(turn.rows());
  if (map_.translation.size() != turn.rows() || !map_.translation.allFinite()) {
    Refuse("translation has to be " + std::to_string(turn.rows()) + " finite numbers");
  }
  if (!std::isfinite(map_.scale) || map_.scale <= 0) {
    Refuse("scale has to be positive, and is " + Short(map_.scale));
  }
}

Eigen::MatrixXd Transformed::Forth(const Eigen::MatrixXd& points) const {
  return (map_.scale * EachTimes(map_.rotation, points)).colwise() + map_.translation;
}

Eigen::MatrixXd Transformed::Back(const Eigen::MatrixXd& points) const {
  return EachTimes(map_.rotation.transpose(), points.colwise() - map_.translation) / map_.scale;
}

void Transformed::MakeForth(Answer* answer) const {
  answer->points = Forth(answer->points);
  if (answer->sizes.size() > 0) answer->sizes *= map_.scale;
  answer->tangents.resize(0, 0);  // TangentBasis turns them
}

Answer Transformed::ClosestPoint(const Eigen::MatrixXd& x) {
  Answer answer = inner_->ClosestPoint(Back(x));
  MakeForth(&answer);
  return answer;
}

bool Transformed::has_intersect_flat() const {
  return inner_->has_intersect_flat() && map_.rotation.rows() == map_.rotation.cols();
}

Answer Transformed::IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                                  const Eigen::VectorXd& radii) {
  const int d = ambient_dimension(), k = dimension();
  Eigen::MatrixXd turned(bases.rows(), bases.cols());
  for (Eigen::Index j = 0; j < bases.cols(); ++j) {
    Eigen::Map<RowMajor>(turned.col(j).data(), d, k).noalias() =
        map_.rotation.transpose() * Eigen::Map<const RowMajor>(bases.col(j).data(), d, k);
  }
  Answer answer = inner_->IntersectFlat(Back(centers), turned, radii / map_.scale);
  MakeForth(&answer);
  return answer;
}

Eigen::MatrixXd Transformed::TangentBasis(const Eigen::MatrixXd& points) {
  const Eigen::Index d = map_.rotation.cols(), k = dimension();
  const Eigen::MatrixXd inner = inner_->TangentBasis(Back(points));
  Eigen::MatrixXd bases(ambient_dimension() * k, points.cols());
  for (Eigen::Index j = 0; j < points.cols(); ++j) {
    Eigen::Map<RowMajor>(bases.col(j).data(), ambient_dimension(), k).noalias() =
        map_.rotation * Eigen::Map<const RowMajor>(inner.col(j).data(), d, k);
  }
  return bases;
}

Eigen::VectorXd Transformed::LocalSize(const Eigen::MatrixXd& points) {
  return map_.scale * inner_->LocalSize(Back(points));
}

// The box about the turned box, with room across the space that M lies in.
std::optional<BoundingBox> Transformed::bounding_box() const {
  std::optional<BoundingBox> box = inner_->bounding_box();
  if (!box) return box;
  const Eigen::VectorXd middle = Forth((box->lower + box->upper) / 2);
  Eigen::VectorXd half = map_.scale * (map_.rotation.cwiseAbs() * ((box->upper - box->lower) / 2));
  half = half.cwiseMax(Eigen::VectorXd::Constant(half.size(), 1e-3 * half.maxCoeff()));
  return BoundingBox{middle - half, middle + half};
}

std::string Transformed::about() const {
  std::string about = AboutOf({inner_});
  if (about.empty() || map_.scale == 1) return about;
  return about + ", scaled by " + Short(map_.scale);  // lengths in it are those of before
}

Eigen::MatrixXd Transformed::seeds() const {
  const Eigen::MatrixXd seeds = inner_->seeds();
  return seeds.size() == 0 ? seeds : Forth(seeds);
}

}  // namespace stellate::oracles
