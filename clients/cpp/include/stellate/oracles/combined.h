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
//
//   stellate::oracles::Product flat_torus({circle, circle});  // in R^4
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

// A manifold whose axes have different units: what is meshed is {x / scale : x in M}, and the mesh,
// and the places that its report names, are in x. epsilon and all other lengths are of x / scale.
// See docs/fields/scaling.md; MeshOptions::scale is this for one mesh.
//
//   stellate::oracles::InUnits states(oracle, Eigen::Vector3d(0.01, 500, 1));
//   const auto mesh = stellate::MeshManifold(states, options);  // mesh->points as of `oracle`
//
// It takes an oracle that has DividedBy, as those of equations, charts, walls and solids have, or
// one length for all axes and no walls.
class InUnits final : public Oracle {
 public:
  // `scale` (d): about how far M goes along each axis.
  InUnits(std::shared_ptr<Oracle> oracle, const Eigen::VectorXd& scale);

  int dimension() const override { return scaled_->dimension(); }
  int ambient_dimension() const override { return scaled_->ambient_dimension(); }
  Answer ClosestPoint(const Eigen::MatrixXd& y) override;
  bool has_intersect_flat() const override { return scaled_->has_intersect_flat(); }
  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override;
  bool has_tangent_basis() const override { return scaled_->has_tangent_basis(); }
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override;
  // As the oracle says at x: lengths of x / scale.
  bool has_local_size() const override { return own_->has_local_size(); }
  Eigen::VectorXd LocalSize(const Eigen::MatrixXd& points) override;
  int equations() const override { return scaled_->equations(); }
  Eigen::MatrixXd EquationGradients(const Eigen::MatrixXd& points) override;
  int walls() const override { return scaled_->walls(); }
  Answer FacePoint(const Eigen::MatrixXd& y, const Walls& face) override;
  Eigen::MatrixXd Clearances(const Eigen::MatrixXd& points) override;
  Eigen::MatrixXd Conormals(const Eigen::MatrixXd& points, const Walls& face) override;
  std::vector<std::uint8_t> labels() const override { return scaled_->labels(); }
  std::vector<Walls> closures() const override { return scaled_->closures(); }
  std::vector<std::string> region_names() const override { return own_->region_names(); }
  std::optional<BoundingBox> bounding_box() const override { return scaled_->bounding_box(); }
  Eigen::MatrixXd seeds() const override { return scaled_->seeds(); }
  std::string about() const override;
  Eigen::VectorXd coordinate_scale() const override { return units_; }

 private:
  std::shared_ptr<Oracle> own_, scaled_;
  Eigen::VectorXd units_;
};

}  // namespace stellate::oracles
