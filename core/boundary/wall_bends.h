#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "core/complex/stars.h"

namespace stellate::core {

// The bend of a wall between two neighbouring vertices that are on no other wall.
struct WallBend {
  int wall = 0;
  double degrees = 0;     // between the conormals at the two
  double length = 0;      // from one to the other
  Eigen::VectorXd point;  // the middle between them
  double radius() const;  // of a circle that bends by as much over that length
  // Returns the epsilon to advise for a reach of that radius (TooCoarse).
  double size_to_take() const { return 0.4 * radius(); }
};

// Returns the bend of least radius among those that exceed the errors of conormals; never one
// between a vertex that is alone on its piece (LoneVertex) and one that is not. `far`: as for
// LoneVertex.
template <int K>
std::optional<WallBend> SharpestBend(const Stars<K>& stars, double far);

// Returns a vertex on only one wall that has no neighbour on the same piece of it within `far`: all
// of that piece is too near to its first vertex. A neighbour on another sheet of the wall does not
// count: it faces away, or lies far off the wall's tangent space.
template <int K>
std::optional<std::uint32_t> LoneVertex(const Stars<K>& stars, double far);

// Two corners, vertices on K walls each, and how far from each other they are, length.
struct NearCorners {
  std::uint32_t first = 0, second = 0;
  double distance = 0;
};

// Returns the pair of corners nearest to each other.
template <int K>
std::optional<NearCorners> NearestCorners(const Stars<K>& stars);

}  // namespace stellate::core
