#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/base/instantiate.h"
#include "core/refinement/engine.h"

namespace stellate::core {

// Where there is room for points of the interior of a manifold with boundary whose faces are
// meshed: what is laid there comes too near to no vertex of theirs, and spoils no simplex.
template <int K>
class InteriorRoom {
 public:
  // The engine is borrowed. spacing: of what is laid, length
  InteriorRoom(const Engine<K>& engine, double spacing);

  bool HasRoomFor(const double* point) const;
  // Which columns there is room for, if they are `found`.
  std::vector<std::uint8_t> HaveRoom(const Eigen::MatrixXd& points,
                                     const std::vector<std::uint8_t>& found) const;

  // Whether a point, known to be in M but for the walls, is in M: it is `reach` or less from one
  // that is. Between a vertex of M and a point beyond a wall lies a point of that, and the faces'
  // vertices cover the walls.
  bool IsSurelyInside(const double* point, double reach) const;
  // Whether a wall that passes within `reach` of the point has vertices.
  bool KnowsWallNear(const double* point, double reach) const;

 private:
  const StarComplex<K>& complex_;
  double epsilon_, apart_;
};

STELLATE_DECLARE_CLASS(InteriorRoom)

}  // namespace stellate::core
