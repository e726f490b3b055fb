#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stellate/error.h"
#include "stellate/pointwise.h"

namespace stellate {

// What is known of a manifold of the catalogue without meshing it.
struct ManifoldFacts {
  std::string spec;         // as given to MakeManifold
  std::string description;  // one line
  int dimension = 0, ambient_dimension = 0;
  int euler_characteristic = 0;
  bool orientable = true;
  std::vector<int> betti_mod2, betti_mod3;  // Betti numbers 0..k over Z/2 and Z/3
  std::optional<double> reach;              // exact where known in closed form
};

// A manifold of the catalogue, perhaps turned isometrically into a larger space. Closest points
// are global, by closed form or by Newton's method from an exhaustive start, to about 1e-14 of the
// manifold's size; the cost of a query is linear in d. Safe to use from several threads.
class Manifold final : public Oracle {
 public:
  // `frame` is d x (shape's d) with orthonormal columns; empty: the identity.
  Manifold(std::unique_ptr<PointwiseOracle> shape, ManifoldFacts facts, Eigen::MatrixXd frame);

  int dimension() const override { return facts_.dimension; }
  int ambient_dimension() const override { return facts_.ambient_dimension; }
  bool has_intersect_flat() const override { return true; }
  bool has_tangent_basis() const override { return true; }
  // The local feature size, exactly, where it is known in closed form.
  bool has_local_size() const override { return shape_->has_local_size(); }
  Answer ClosestPoint(const Eigen::MatrixXd& x) override;
  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override;
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override;
  Eigen::VectorXd LocalSize(const Eigen::MatrixXd& points) override;
  std::optional<BoundingBox> bounding_box() const override;

  const ManifoldFacts& facts() const { return facts_; }
  // The exact distance of each column of x (d x n) to the manifold.
  Eigen::VectorXd Distance(const Eigen::MatrixXd& x);

 private:
  std::unique_ptr<PointwiseOracle> shape_;
  ManifoldFacts facts_;
  Eigen::MatrixXd frame_;
};

// Makes a manifold by its name:
//
//   const auto torus = stellate::MakeManifold("torus:1:0.4");
//   if (torus) std::cerr << (*torus)->facts().description << '\n';
//
// The name is "name:parameter:..." or "name:parameter:...@d", the latter turned into R^d by a
// rotation that depends on the dimensions alone. kRefused: there is none of that name, or its
// parameters are wrong.
Expected<std::unique_ptr<Manifold>> MakeManifold(const std::string& spec);

// A kind of manifold that MakeManifold makes.
struct CatalogueEntry {
  std::string syntax;       // e.g. "torus[:R:r]"
  std::string example;      // a spec that MakeManifold takes
  std::string description;  // one line
};
const std::vector<CatalogueEntry>& ListManifolds();

}  // namespace stellate
