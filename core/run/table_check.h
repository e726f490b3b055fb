#pragma once

#include <Eigen/Core>
#include <map>
#include <utility>

#include "core/refinement/candidate_set.h"
#include "core/status.h"

namespace stellate::core {

// Checks what a specification says of its walls, of an arrangement, by all answers: that no point
// has signs that the labels call impossible, that walls vanish together which the closures say do,
// and no others, along a face.
class TableCheck {
 public:
  // `k`: of M. Returns what an answer contradicts, with its place, else Ok.
  Status Judge(const AnsweredPoints& answers, int k);

 private:
  // Points of a face, not a corner, where further walls are zero, by these two.
  std::map<std::pair<WallSet, WallSet>, int> coincidences_;
  Eigen::VectorXd largest_;  // of each wall's clearances so far: their scale
};

}  // namespace stellate::core
