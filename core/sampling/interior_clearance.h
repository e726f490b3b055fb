#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/base/instantiate.h"
#include "core/refinement/engine.h"

namespace stellate::core {

// Tests where interior points of a manifold with boundary may be placed, once its faces are meshed:
// not too near to a vertex of a face, and without encroaching on a simplex.
template <int K>
class InteriorClearance {
 public:
  // The engine must outlive this. spacing: of the interior points, length
  InteriorClearance(const Engine<K>& engine, double spacing);

  bool IsClear(const double* point) const;
  // Returns by column whether it is `found` and clear.
  std::vector<std::uint8_t> AreClear(const Eigen::MatrixXd& points,
                                     const std::vector<std::uint8_t>& found) const;

  // Whether a point of M^ is certainly inside all walls, given an interior point within `reach`:
  // between a vertex of M and a point beyond a wall lies a point of that wall, and the faces'
  // vertices cover the walls.
  bool IsSurelyInside(const double* point, double reach) const;
  // Whether a vertex on a wall lies within `reach` of the point.
  bool KnowsWallNear(const double* point, double reach) const;

 private:
  const Stars<K>& stars_;
  double epsilon_, apart_;
};

STELLATE_DECLARE_CLASS(InteriorClearance)

}  // namespace stellate::core
