#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "core/base/instantiate.h"
#include "core/refinement/candidate_set.h"
#include "core/refinement/engine_parts.h"

namespace stellate::core {

// A corner of more than K walls that cannot be refined: M has no interior there, or more than K - 1
// of them (`along`) meet along an edge that leaves it, or there are too many (kMostAtCorner). Of an
// arrangement: some of them (`beside`) pass so near that they may be meant to meet there, or some
// direction has signs that the labels call impossible.
struct CrowdedCorner {
  Eigen::VectorXd point;
  WallSet walls = 0, along = 0, beside = 0;
  bool is_impossible = false;
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
  using Crowd = typename BoundaryState<K>::Crowd;
  // A crowd with what its questions found: all walls that pass through it or nearly so, K numbers
  // each, ascending.
  struct Known {
    const Crowd& crowd;
    WallSet at, beside;
    std::map<int, Eigen::Matrix<double, K, 1>> conormals;
    // Of some of its walls, as ConeOf takes them.
    std::vector<double> ConormalsOf(WallSet walls) const {
      std::vector<double> all;
      ForEachWall(walls, [&](int wall) {
        const auto& conormal = conormals.at(wall);
        all.insert(all.end(), conormal.data(), conormal.data() + K);
      });
      return all;
    }
  };
  Known KnownOf(const Crowd& crowd, const AnsweredPoints& answers, Eigen::Index first) const;
  std::optional<CrowdedCorner> SettleCone(const Known& known);
  std::optional<CrowdedCorner> SettleSectors(const Known& known);
  void Insert(const Known& known, WallSet walls, WallSet signs);

  EngineParts<K> engine_;
};

STELLATE_DECLARE_CLASS(Corners)

}  // namespace stellate::core
