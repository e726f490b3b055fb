#pragma once

#include <string>
#include <vector>

#include "core/boundary/boundary_policy.h"
#include "core/refinement/candidate_set.h"
#include "core/refinement/criteria.h"

namespace stellate::core {

// Detects an undeclared boundary: collects answers with a tangential offset, which do not lie
// straight below their queries (UndeclaredBoundaryCheck). A closed manifold with exact tangents has
// none.
class BoundaryDetector {
 public:
  // `criteria`: its steps between flats and M, which have tangential offsets themselves.
  BoundaryDetector(const BoundaryPolicy& policy, const ResolvedCriteria& criteria)
      : may_tell_(policy.MayEndUndeclared() && criteria.flat_alternations == 1) {}

  // Collects offsets from the closest points of candidates, with their tangents, if they may tell
  // anything: not of declared walls, nor with alternations. `asked`: by candidate, d x n.
  template <int K>
  void Look(const CandidateSet<K>& candidates, const Eigen::MatrixXd& asked,
            const AnsweredPoints& answers);

  // Points y of M and the components of q - y along M, 2 d each, as KnownOfManifold has them.
  const std::vector<double>& offsets() const { return offsets_; }
  // A sentence about them for the verdict of an unfinished run, or "".
  std::string Describe(int d) const;

 private:
  bool may_tell_;
  std::vector<double> offsets_;
};

}  // namespace stellate::core
