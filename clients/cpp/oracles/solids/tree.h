#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "oracles/solids/motion.h"
#include "oracles/solids/wall.h"

// Solids as Booleans of the signs of walls.
namespace stellate::solids {

struct Node;
using NodePtr = std::shared_ptr<const Node>;

struct Node {
  enum class Kind {
    kHalf,    // where a wall is positive
    kNot,     // the complement of its one part
    kAll,     // the intersection; of no parts it is all of space
    kEither,  // the union; of no parts it is nothing
  };
  Kind kind;
  WallPtr wall;                // of a half
  std::vector<NodePtr> parts;  // of the others
  BodyPtr hull;                // of an intersection: it lies within, where there is one

  bool is_body() const { return hull != nullptr; }
};

NodePtr Half(WallPtr wall);
NodePtr Not(NodePtr of);
NodePtr All(std::vector<NodePtr> parts, BodyPtr hull = nullptr);
NodePtr Either(std::vector<NodePtr> parts);

NodePtr Moved(const NodePtr& node, const Motion& motion);

// All walls that occur, as often as they do.
std::vector<WallPtr> WallsOf(const Node& node);
// The most that direction . x may be there: infinite where it is not known to have a most.
double Support(const Node& node, const Eigen::VectorXd& direction);
// The same solid, without planes that pass by the bodies which it is intersected with.
NodePtr Simplified(const NodePtr& node);

// The sign of a plane that no point of the hull has, if one of them is not there: 1, -1, or 0.
int SignBeyond(const Body& hull, const Plane& plane);

}  // namespace stellate::solids
