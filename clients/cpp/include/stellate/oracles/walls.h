#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stellate/catalogue.h"
#include "stellate/oracle.h"

namespace stellate {
class Exactness;
}

// Manifolds with boundary: what walls leave of another manifold, and domains of space. All are as
// safe to call from several threads as what they are made of. Constructors throw
// std::invalid_argument.
namespace stellate::oracles {

// {g >= 0}, g smooth near where it is zero; what counts elsewhere is its sign.
struct Wall {
  std::function<double(const Eigen::VectorXd& x)> g;  // d -> 1
  // d -> d; without it, differences.
  std::function<Eigen::VectorXd(const Eigen::VectorXd& x)> gradient = nullptr;
};

// {x : normal . x >= offset}.
Wall HalfSpace(const Eigen::VectorXd& normal, double offset = 0);
// The sides of a box, lower ones first; an infinite side is none.
std::vector<Wall> Box(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper);
// The inside of a ball.
Wall Ball(const Eigen::VectorXd& centre, double radius);

// {x in M : g(x) >= 0 for all walls g}: a manifold with boundary, edges and corners.
//
//   const stellate::oracles::Wall upper = stellate::oracles::HalfSpace(Eigen::Vector2d::UnitY());
//   stellate::oracles::Clipped arc(circle, {upper});
//
// Where several walls meet on M they have to cross at an angle: tangential walls are refused. Asked
// for values of a wall that rounds to single precision it throws OracleError.
class Clipped : public Oracle {
 public:
  // Of M, with tangent bases; 1 to 64 walls. Those of an oracle that is Clipped itself come first.
  // `seeds` (d x s) are points near what is left, where M's box or seeds are not to be gone by.
  // `labels`, as Oracle::labels has them: the part of M with labels other than 0 instead of what is
  // positive. What has labels cannot be clipped. `closures` as Oracle::closures has them.
  Clipped(std::shared_ptr<Oracle> oracle, std::vector<Wall> walls, Eigen::MatrixXd seeds = {},
          std::vector<std::uint8_t> labels = {}, std::vector<Walls> closures = {});

  int dimension() const override { return base_->dimension(); }
  int ambient_dimension() const override { return base_->ambient_dimension(); }
  int walls() const override { return static_cast<int>(walls_.size()); }
  std::vector<std::uint8_t> labels() const override { return labels_; }
  std::vector<Walls> closures() const override { return closures_; }
  // Of M, whatever the walls say.
  Answer ClosestPoint(const Eigen::MatrixXd& x) override { return base_->ClosestPoint(x); }
  bool has_intersect_flat() const override;
  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override {
    return base_->IntersectFlat(centers, bases, radii);
  }
  bool has_tangent_basis() const override { return true; }
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override {
    return base_->TangentBasis(points);
  }
  bool has_local_size() const override { return base_->has_local_size(); }
  Eigen::VectorXd LocalSize(const Eigen::MatrixXd& points) override {
    return base_->LocalSize(points);
  }
  Answer FacePoint(const Eigen::MatrixXd& x, const Walls& face) override;
  Eigen::MatrixXd Clearances(const Eigen::MatrixXd& points) override;
  Eigen::MatrixXd Conormals(const Eigen::MatrixXd& points, const Walls& face) override;
  int equations() const override { return base_->equations(); }
  Eigen::MatrixXd EquationGradients(const Eigen::MatrixXd& points) override {
    return base_->EquationGradients(points);
  }
  std::optional<BoundingBox> bounding_box() const override { return base_->bounding_box(); }
  Eigen::MatrixXd seeds() const override { return seeds_; }
  std::string about() const override { return base_->about(); }
  std::shared_ptr<Oracle> DividedBy(const Eigen::VectorXd& scale) const override;

 private:
  void InsistOnExactness(int wall) const;
  Walls Independent(const Walls& face) const;
  Eigen::VectorXd Slope(int wall, const Eigen::VectorXd& x) const;

  std::shared_ptr<Oracle> base_;
  std::vector<Wall> walls_;
  std::vector<std::shared_ptr<const Exactness>> exactness_;  // of each wall
  Eigen::MatrixXd seeds_;
  std::vector<std::uint8_t> labels_;
  std::vector<Walls> closures_;
  double scale_ = 1;  // of where M is: the unit of lengths
};

// {x in R^d : g(x) >= 0 for all walls g}, as a manifold of dimension d with boundary.
class Solid final : public Clipped {
 public:
  // `seeds`, `labels` and `closures` as Clipped takes them.
  Solid(std::vector<Wall> walls, BoundingBox around, Eigen::MatrixXd seeds = {},
        std::vector<std::uint8_t> labels = {}, std::vector<Walls> closures = {});
};

// A manifold with boundary, from nearest points of it and nearest points of its boundary.
//
// Nothing else is needed: tangent spaces, where an oracle has none, and the boundary's outward
// normals come from differences of nearest points. Where the boundary has corners, or where there
// are equations for it, take Clipped. Oracles of different manifolds are detected by the points
// where they differ, in a std::runtime_error.
class ManifoldWithBoundary final : public Oracle {
 public:
  // d -> 1: positive in M, zero on its boundary, negative beyond it.
  using Clearance = std::function<double(const Eigen::VectorXd& x)>;

  // `oracle`, of dimension k, answers with nearest points of M itself, so on the boundary where it
  // is asked from beyond that; or, with a clearance, of a manifold that M is a part of. `boundary`
  // is closed, of dimension k - 1. `tolerance`, of M's size: a nearest point so near the boundary
  // is on it; the two oracles may disagree by as much about where M ends.
  ManifoldWithBoundary(std::shared_ptr<Oracle> oracle, std::shared_ptr<Oracle> boundary,
                       Clearance clearance = {}, double tolerance = 1e-6);

  int dimension() const override { return inner_->dimension(); }
  int ambient_dimension() const override { return inner_->ambient_dimension(); }
  int walls() const override { return 1; }
  // Of M, and straight on beyond its boundary.
  Answer ClosestPoint(const Eigen::MatrixXd& x) override;
  bool has_tangent_basis() const override { return true; }
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override;
  bool has_local_size() const override { return inner_->has_local_size(); }
  Eigen::VectorXd LocalSize(const Eigen::MatrixXd& points) override {
    return inner_->LocalSize(points);
  }
  Answer FacePoint(const Eigen::MatrixXd& x, const Walls& face) override;
  // Distances to the boundary, below zero beyond it; or the clearance.
  Eigen::MatrixXd Clearances(const Eigen::MatrixXd& points) override;
  Eigen::MatrixXd Conormals(const Eigen::MatrixXd& points, const Walls& face) override;
  std::optional<BoundingBox> bounding_box() const override;
  Eigen::MatrixXd seeds() const override;
  std::string about() const override;

 private:
  Eigen::MatrixXd Outward(const Eigen::MatrixXd& points, const Eigen::MatrixXd& bases);
  Eigen::VectorXd Climb(const Eigen::VectorXd& x, const Eigen::MatrixXd& basis) const;
  Eigen::VectorXd ToRim(const Eigen::MatrixXd& points);
  Eigen::VectorXd CheckOn(const Eigen::MatrixXd& points);
  void CheckEnds(const Eigen::MatrixXd& points, const Eigen::MatrixXd& outward,
                 const Eigen::VectorXd& off);

  std::shared_ptr<Oracle> inner_, rim_;
  Clearance clearance_;
  double scale_ = 1, tolerance_;  // lengths: of where M is, and what is on its boundary
};

// Makes "name:parameter:...", a manifold with boundary that ListDomains names. kRefused, with
// reason "UNKNOWN_NAME" if there is none of that name.
Expected<std::unique_ptr<Oracle>> MakeDomain(const std::string& spec);
const std::vector<CatalogueEntry>& ListDomains();

}  // namespace stellate::oracles
