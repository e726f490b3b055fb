#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "stellate/oracle.h"

// Manifolds made of others. All take oracles that others may hold too, and are as safe to call from
// several threads as these are. Constructors throw std::invalid_argument.
namespace stellate::oracles {

// The product A x B x ... in R^(a + b + ...), points one after the other. Has tangent bases and
// local sizes if all of its factors, two at least, have.
class Product final : public Oracle {
 public:
  explicit Product(std::vector<std::shared_ptr<Oracle>> factors);

  int dimension() const override { return dimension_; }
  int ambient_dimension() const override { return ambient_dimension_; }
  Answer ClosestPoint(const Eigen::MatrixXd& x) override;
  bool has_tangent_basis() const override;
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override;
  bool has_local_size() const override;
  Eigen::VectorXd LocalSize(const Eigen::MatrixXd& points) override;
  std::optional<BoundingBox> bounding_box() const override;
  Eigen::MatrixXd seeds() const override;
  std::string about() const override;

 private:
  std::vector<std::shared_ptr<Oracle>> factors_;
  int dimension_ = 0, ambient_dimension_ = 0;
};

// x -> scale * rotation x + translation, of R^d into R^D.
struct Similarity {
  Eigen::MatrixXd rotation;     // D x d with orthonormal columns, D >= d; empty: the identity
  double scale = 1;             // positive
  Eigen::VectorXd translation;  // D; empty: zero
};

// The image of a manifold. Intersects flats if the oracle does and D = d.
class Transformed final : public Oracle {
 public:
  Transformed(std::shared_ptr<Oracle> oracle, Similarity similarity);

  int dimension() const override { return inner_->dimension(); }
  int ambient_dimension() const override { return static_cast<int>(map_.rotation.rows()); }
  Answer ClosestPoint(const Eigen::MatrixXd& x) override;
  bool has_intersect_flat() const override;
  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override;
  bool has_tangent_basis() const override { return inner_->has_tangent_basis(); }
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override;
  bool has_local_size() const override { return inner_->has_local_size(); }
  Eigen::VectorXd LocalSize(const Eigen::MatrixXd& points) override;
  std::optional<BoundingBox> bounding_box() const override;
  Eigen::MatrixXd seeds() const override;
  std::string about() const override;

 private:
  Eigen::MatrixXd Forth(const Eigen::MatrixXd& points) const;
  Eigen::MatrixXd Back(const Eigen::MatrixXd& points) const;
  void MakeForth(Answer* answer) const;

  std::shared_ptr<Oracle> inner_;
  Similarity map_;
};

}  // namespace stellate::oracles
