#pragma once

#include <string>
#include <vector>

#include "core/refinement/candidate_set.h"

namespace stellate::core {

// Notes where M may end: answers that do not lie straight below what was asked (RimCheck). From a
// closed manifold with exact tangents there are none.
class RimWatch {
 public:
  // Closest points of candidates, with their tangents. REQUIRES: no alternations.
  template <int K>
  void Look(const CandidateSet<K>& candidates, const AnsweredPoints& answers);

  // Points y of M and the parts of q - y along it, 2 d each, as KnownOfManifold has them.
  const std::vector<double>& leans() const { return leans_; }
  // What an unfinished run says of them, d numbers a point: a further sentence, or nothing.
  std::string Describe(int d) const;

 private:
  std::vector<double> leans_;
};

}  // namespace stellate::core
