#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "stellate/implicit.h"
#include "stellate/oracle.h"
#include "stellate/pointwise.h"

// Manifolds given by equations of particular kinds; stellate/implicit.h has equations in general.
// Constructors throw std::invalid_argument, and ConstraintSet's OracleError as ImplicitOracle does,
// and LevelSet's for a function that rounds to single precision.
namespace stellate::oracles {

// What a surface on a grid does at the box's sides: it does not reach them; or it may, and goes on
// beyond, to be clipped by Clipped with the grid's box.
enum class GridBorder { kClosed, kOpen };

// The zero set of a signed distance, or of any smooth function with a gradient that is not zero
// there: a network that was trained to be one, for example.
//
// A distance has kinks on the medial axis, which the solvers survive.
class SignedDistance final : public ImplicitOracle {
 public:
  using Function = std::function<double(const Eigen::VectorXd& x)>;           // d -> 1
  using Gradient = std::function<Eigen::VectorXd(const Eigen::VectorXd& x)>;  // d -> d

  // The set of f = level in the box. An empty gradient: differences of f.
  SignedDistance(Function f, Gradient gradient, BoundingBox box, double level = 0);

  // The set of the cubic spline through values on a grid: `shape` values along each axis at even
  // distances, the first and the last on the box, the last axis' next to each other in `values`.
  //
  // The spline is smooth (C^2) and reproduces the values. What the grid does not resolve it cannot
  // know: thin parts and gaps of fewer than some three spacings come out otherwise or not at all,
  // and the set is within about spacing^2 times the curvature of the one that was sampled. An
  // epsilon below the resolution meshes the spline ever better, and not what was sampled.
  //
  // Any smooth function's values will do, of either sign inside. Refused where there is no such
  // set, where it leaves the grid, and where values are those of labels or a mask.
  static SignedDistance OfGrid(const Eigen::VectorXd& values, const std::vector<int>& shape,
                               const BoundingBox& box, double level = 0,
                               GridBorder border = GridBorder::kClosed);

  // The largest spacing of the grid; 0 where there is none.
  double resolution() const { return resolution_; }
  std::string about() const override { return about_; }  // of a grid, its values and their spacing

 private:
  double resolution_ = 0;
  std::string about_;
};

// One or several equations f = 0 out of many.
struct Constraint {
  ImplicitOracle::Function f;         // d -> m
  ImplicitOracle::Jacobian jacobian;  // d -> m x d; empty: differences of f
};

// Where all constraints hold, a manifold of d minus as many dimensions as there are equations.
//
// Refused where one of them follows from the others: as a function, or at points of the set.
class ConstraintSet final : public ImplicitOracle {
 public:
  ConstraintSet(int ambient_dimension, std::vector<Constraint> constraints, BoundingBox box);
};

// A bar between two joints.
struct Bar {
  std::string a, b;  // joints
  double length;
};

// All ways in which joints can lie, some fixed, pairs of them held at given distances.
//
// The points of M are the positions of the joints that move, one after the other, in the order in
// which the bars name them. M has dimension (joints that move) * (2 or 3) - bars and is a manifold
// for almost all lengths: not where all bars of a loop can lie on one line.
//
//   const stellate::oracles::Linkage::Places fixed = {{"base", Eigen::Vector2d(0, 0)}};
//   stellate::oracles::Linkage arm({{"base", "elbow", 1}, {"elbow", "hand", 1}}, fixed);  // k = 2
class Linkage final : public ImplicitOracle {
 public:
  using Places = std::map<std::string, Eigen::VectorXd>;  // in the plane, or in space

  Linkage(const std::vector<Bar>& bars, const Places& fixed);

  const std::vector<std::string>& moving() const { return moving_; }
  // Where each joint is at points of M (d x n): 2 x n or 3 x n, by name; the fixed ones too.
  std::map<std::string, Eigen::MatrixXd> Joints(const Eigen::MatrixXd& points) const;

 private:
  struct Plan;
  explicit Linkage(const Plan& plan);

  std::vector<std::string> moving_;
  Places fixed_;
};

// {x in M : f(x) = 0}, of a manifold M with tangent bases and a smooth f: R^d -> R^m whose
// derivative along M has rank m where f is zero. It has dimension k - m.
class LevelSet final : public PointwiseOracle {
 public:
  using Function = ImplicitOracle::Function;  // d -> m
  using Jacobian = ImplicitOracle::Jacobian;  // d -> m x d

  // An empty `jacobian` is replaced by differences of f. `seeds` (d x s) are points near the set,
  // where M's box or seeds are not to be gone by.
  LevelSet(std::shared_ptr<Oracle> oracle, Function f, Jacobian jacobian = {},
           Eigen::MatrixXd seeds = {});

  // Servers find intersections from closest points.
  bool has_intersect_flat() const override { return false; }
  std::optional<BoundingBox> bounding_box() const override;
  Eigen::MatrixXd seeds() const override;
  std::string about() const override;

  // Down to the level and along it towards x, in M's tangent space, and back to M, again and
  // again; a step is halved while it oversteps.
  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override;
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override;

 private:
  Eigen::MatrixXd J(const Eigen::VectorXd& x) const;
  Eigen::MatrixXd BaseTangent(const Eigen::VectorXd& y) const;

  std::shared_ptr<Oracle> base_;
  Function f_;
  Jacobian jacobian_;
  Eigen::MatrixXd seeds_;
  double scale_;  // of where M is: the unit of lengths
};

}  // namespace stellate::oracles
