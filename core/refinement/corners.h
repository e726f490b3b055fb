#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/base/instantiate.h"
#include "core/refinement/candidate_set.h"
#include "core/refinement/engine_parts.h"

namespace stellate::core {

// A corner of more than K walls that cannot be refined: M has no interior there, or more than K - 1
// of them (`along`) meet along an edge that leaves it, or there are too many (kMostAtCorner).
struct CrowdedCorner {
  Eigen::VectorXd point;
  WallSet walls, along;
};

// Finds how M looks at corners: where more than K walls meet, and where the first points of edges
// are.
template <int K>
class Corners {
 public:
  explicit Corners(const EngineParts<K>& engine) : engine_(engine) {}

  // Plans, before all other points, one point on each edge of each corner. All are equally far from
  // the corner, so that two edges at a sharp angle do not split each other without end.
  PlannedPoints PlanShells();

  // Corners that more than K walls may meet in: query Questions, then pass the answers to Settle.
  // It inserts them, or leaves them out where M is only that point. Returns one that cannot be
  // refined, if any.
  PlannedPoints Questions() const;
  std::optional<CrowdedCorner> Settle(const AnsweredPoints& answers);

 private:
  EngineParts<K> engine_;
};

STELLATE_DECLARE_CLASS(Corners)

}  // namespace stellate::core
