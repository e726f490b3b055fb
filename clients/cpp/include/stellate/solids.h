#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stellate/error.h"
#include "stellate/oracle.h"
#include "stellate/oracles/walls.h"

// Solids composed of others, by &, |, -, ^ and ~: what stellate.solids is in Python, with the same
// walls and labels. Each is an oracle, with its edges and corners:
//
//   namespace s = stellate::solids;
//   const Eigen::Vector3d one = Eigen::Vector3d::Ones(), x = Eigen::Vector3d::UnitX();
//   s::Solid part = (s::Box(-one, one) & s::Ball(1.3)) - s::Cylinder(0.5, {}, x);
//   const auto mesh = stellate::MeshManifold(part, options);
//
// What is composed of what cannot be, and what cannot be meshed, throws std::invalid_argument: what
// makes a solid when it is made, a query of it when it is first asked. Oracles here are as safe to
// call from several threads as the functions that Implicit was given.
namespace stellate::solids {

struct Node;  // of a solid's tree, which is the library's own

// The oracle of something composed, made when it is first asked. A copy shares it.
class Composed : public Oracle {
 public:
  int dimension() const override { return dimension_; }
  int ambient_dimension() const override { return dimension_; }
  Answer ClosestPoint(const Eigen::MatrixXd& x) override { return made().ClosestPoint(x); }
  bool has_tangent_basis() const override { return true; }
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override {
    return made().TangentBasis(points);
  }
  int walls() const override { return made().walls(); }
  std::vector<std::uint8_t> labels() const override { return made().labels(); }
  std::vector<Walls> closures() const override { return made().closures(); }
  Answer FacePoint(const Eigen::MatrixXd& x, const Walls& face) override {
    return made().FacePoint(x, face);
  }
  Eigen::MatrixXd Clearances(const Eigen::MatrixXd& points) override {
    return made().Clearances(points);
  }
  Eigen::MatrixXd Conormals(const Eigen::MatrixXd& points, const Walls& face) override {
    return made().Conormals(points, face);
  }
  std::optional<BoundingBox> bounding_box() const override { return made().bounding_box(); }
  std::shared_ptr<Oracle> DividedBy(const Eigen::VectorXd& scale) const override {
    return made().DividedBy(scale);
  }

 protected:
  Composed(int dimension, std::function<oracles::Solid()> make);

 private:
  struct Lazy;
  oracles::Solid& made() const;

  int dimension_;
  std::shared_ptr<Lazy> lazy_;
};

// All walls of a solid, and for each vector of their signs, in whose number bit i is set where wall
// i is positive: 1 inside, 0 outside, -1 where no point can have the signs.
struct LabelTable {
  std::vector<oracles::Wall> walls;
  std::vector<std::int8_t> labels;  // 2^walls
};

// A solid of R^d: walls, and a Boolean of their signs. Walls that are the same in several parts are
// one.
//
// What is an intersection of half-walls, once what does not matter is left out, is meshed by these
// alone: wall i of the mesh is HalfWalls()[i]. Of others all walls that matter count, with a label
// for each vector of their signs: 16 at most.
class Solid final : public Composed {
 public:
  Solid(std::shared_ptr<const Node> tree, int dimension);

  Solid operator&(const Solid& other) const;  // the intersection
  Solid operator|(const Solid& other) const;  // the union
  Solid operator-(const Solid& other) const;  // what is in this one alone
  Solid operator^(const Solid& other) const;  // what is in one of the two
  Solid operator~() const;                    // the complement

  // Moved by a vector: what is about 0 comes to lie about the point.
  Solid At(const Eigen::VectorXd& point) const;
  // Turned about 0 by an orthogonal matrix, d x d, such as
  // Eigen::AngleAxisd(angle, axis).toRotationMatrix().
  Solid Rotated(const Eigen::MatrixXd& rotation) const;
  // Enlarged from 0 by a factor above 0.
  Solid Scaled(double factor) const;
  // All within a distance of it; below 0, what is farther than that from its outside. Of solids of
  // one wall whose values are distances: balls, tori, capsules, cylinders without ends,
  // half-spaces, Implicit's where it is said, and the complements of these.
  Solid Offset(double distance) const;

  // Whether a point is inside. Any solid knows.
  bool Contains(const Eigen::VectorXd& x) const;
  LabelTable Table() const;
  // All positive inside and nowhere else, each needed: oracles::Clipped takes them, to cut another
  // manifold by. Refused where the solid is no intersection of half-walls.
  std::vector<oracles::Wall> HalfWalls() const;

  const std::shared_ptr<const Node>& tree() const { return tree_; }

 private:
  Solid Joined(const Solid& other, std::shared_ptr<const Node> tree) const;

  std::shared_ptr<const Node> tree_;
};

// Several materials: a region for each, labelled 1, 2, ... in their order. Where they overlap the
// later one wins.
//
//   s::Labels composite({{"matrix", s::Box(-one, one)}, {"grain", s::Ball(0.6)}});
//   const auto mesh = stellate::MeshManifold(composite, options);
//   const stellate::Mesh grain = mesh->Region(composite.LabelOf("grain"));
class Labels final : public Composed {
 public:
  explicit Labels(std::vector<std::pair<std::string, Solid>> materials);

  const std::vector<std::string>& names() const { return names_; }
  std::vector<std::string> region_names() const override { return names_; }
  // Throws std::invalid_argument for a name that there is not.
  int LabelOf(std::string_view name) const;

 private:
  std::vector<std::string> names_;
};

// A material, as it competes with others for a point.
struct Phase {
  std::function<double(const Eigen::VectorXd& x)> f;  // smooth near where it is among the largest
  std::function<Eigen::VectorXd(const Eigen::VectorXd& x)> gradient = {};  // empty: differences
  std::string name = {};
};

// Materials that fill a solid: label i + 1 where function i is the largest.
//
//   const s::Phases grains({{f}, {g}, {h}}, s::Ball());
//   const auto mesh = stellate::MeshManifold(grains, options);  // mesh->labels: 1, 2 or 3
//
// Three materials meet along edges, four in points, at whatever angles. The walls between two of
// them have to cross at an angle there, and their functions must not be equal anywhere else than on
// a smooth surface. Wall by wall these are f0 - f1, f0 - f2, ..., f1 - f2, ...; then the solid's.
class Phases final : public Composed {
 public:
  // Two to six phases; there may be 16 walls at most.
  Phases(std::vector<Phase> phases, const Solid& within);

  // What of them is in another solid, too.
  Phases operator&(const Solid& other) const { return {phases_, within_ & other}; }

  // 0 outside of what they fill.
  int LabelAt(const Eigen::VectorXd& x) const;
  std::vector<std::string> region_names() const override;

 private:
  std::vector<Phase> phases_;
  Solid within_;
};

// A ball of R^d, any d: one wall.
Solid Ball(double radius = 1, const Eigen::VectorXd& at = Eigen::Vector3d::Zero());
// The box between two corners of R^d, any d: 2 d walls, the lower ones first.
Solid Box(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper);
// {x : normal . x >= offset}, the normal inwards, of any length: one wall.
Solid HalfSpace(const Eigen::VectorXd& normal, double offset = 0);
// A cylinder of space: its side, and with a height two ends. Without one it goes on without ends,
// to be cut or taken away. `at`: its centre, or a point of its axis.
Solid Cylinder(double radius = 1, std::optional<double> height = std::nullopt,
               const Eigen::Vector3d& axis = Eigen::Vector3d::UnitZ(),
               const Eigen::Vector3d& at = Eigen::Vector3d::Zero());
// A cone of space from its lower end, of a radius, along the axis to its upper one, of radius
// `top`; `at` is the middle between these. With a tip (top 0) it is not meshed as a whole, but
// where the tip is cut away.
Solid Cone(double radius, double height, double top = 0,
           const Eigen::Vector3d& axis = Eigen::Vector3d::UnitZ(),
           const Eigen::Vector3d& at = Eigen::Vector3d::Zero());
// What is within `minor` of a circle of radius `major` around an axis: one wall.
Solid Torus(double major = 1, double minor = 0.4,
            const Eigen::Vector3d& axis = Eigen::Vector3d::UnitZ(),
            const Eigen::Vector3d& at = Eigen::Vector3d::Zero());
// What is within a radius of the segment between two points of space: one wall.
Solid Capsule(const Eigen::Vector3d& start, const Eigen::Vector3d& end, double radius);

struct ImplicitOptions {
  std::optional<BoundingBox> bounding_box;  // without it, it has to be cut by what has an end
  bool distance = false;                    // g's values are distances, so that it can be offset
  int dimension = 3;                        // d; that of the box, if there is one
};
// {x : g(x) >= 0}, g smooth where it is zero: one wall. An empty gradient: differences of g.
Solid Implicit(std::function<double(const Eigen::VectorXd& x)> g,
               std::function<Eigen::VectorXd(const Eigen::VectorXd& x)> gradient = {},
               const ImplicitOptions& options = {});

enum class Join { kUnion, kIntersection, kDifference };
// Two solids of one wall each, as Offset takes them, joined with a fillet where they meet: one wall
// again. The fillet has its radius where the two cross at a right angle.
Solid Blend(const Solid& a, const Solid& b, double radius, Join join = Join::kUnion);

// The solid that an expression describes, such as
// "box(-1, 1) & ball(1.3) - cylinder(x, 0.5) | ball(0.45, at=(0.95, 0.9, 0.2))": the grammar of the
// command line, which docs/using/solids.md has. kRefused: the message names the column, from 1 on,
// and what was expected there, and points to it.
Expected<Solid> ParseSolid(std::string_view expression);

}  // namespace stellate::solids
