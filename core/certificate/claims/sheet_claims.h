#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "core/batch.h"
#include "core/certificate/claims/boundary_claims.h"
#include "core/certificate/claims/clearance_dips.h"
#include "core/certificate/claims/examination.h"
#include "core/certificate/claims/sheet.h"

namespace stellate::core {

// The claim that a mesh with boundary ends at all pieces of each wall, and not only at those that
// refinement came upon. The closest point on each wall is queried from inside the mesh. If it is in
// M, a simplex of the wall's mesh must be near and face as the wall does: a second sheet close to
// the first, such as a void just under the skin, faces the other way.
class SheetClaims {
 public:
  // `ends`, `clear`: what is known, borrowed; answers on walls are added to `ends`.
  SheetClaims(Examination& examination, BoundaryClaims& boundary, EndsOfManifold& ends,
              const ClearPoints& clear);

  // Returns a block for each wall: barycentres of some of the `chosen` simplices. Deep inside, one
  // query does for many simplices: the ball up to a closest point that far away contains no other.
  std::vector<QueryBlock> Questions(const std::vector<std::uint32_t>& chosen);
  // Returns the same from some of these points (d x n), where the inside is not meshed.
  std::vector<QueryBlock> QuestionsFrom(const Eigen::MatrixXd& points) const;
  // Takes the answers to one of these blocks, or to other queries on that wall alone.
  void Judge(std::size_t wall, const Eigen::MatrixXd& asked, const AnswerBlock& answer);

  // Judges the ends that were known before.
  void JudgeKnown();

  // Returns a block for each wall: the points, new since the last call, whose clearance over their
  // distance from the wall's mesh is much smaller than that of points near them. There may be a
  // second sheet near them that no query met: a solver's "closest" point may be far beyond others,
  // and then the ball up to it is not empty.
  std::vector<QueryBlock> QuestionsWhereClearancesDip();

 private:
  std::unique_ptr<Sheet> SheetOf(int wall) const;
  Eigen::VectorXd OutwardAt(const std::uint32_t* facet, std::pair<int, int> sides) const;
  std::vector<std::uint32_t> Spread(const Sheet& sheet, const Eigen::MatrixXd& barycentres,
                                    const std::vector<double>& radii) const;
  QueryBlock QuestionsOf(std::size_t wall, Eigen::MatrixXd points) const;
  // A point of M on a wall, and the conormal there, d each; borrowed.
  struct End {
    const double* y;
    const double* conormal;
    std::pair<int, int> sides;  // as of FaceMesh
  };
  std::optional<std::uint32_t> NearestThatEnds(const Sheet& sheet, const End& end) const;
  std::optional<std::pair<int, int>> SidesOf(int wall, const double* clearances) const;
  void JudgeEnds(std::size_t wall, const std::vector<End>& ends);

  Examination& x_;
  BoundaryClaims& boundary_;
  std::vector<std::unique_ptr<Sheet>> sheets_;  // by wall
  std::vector<ClearanceDips> dips_;             // the same
  EndsOfManifold& ends_;
  const ClearPoints& clear_;
  std::size_t looked_at_ = 0;  // clear points whose dips were asked about
};

}  // namespace stellate::core
