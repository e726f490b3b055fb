#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/batch.h"
#include "core/certificate/claims/boundary_claims.h"
#include "core/certificate/claims/examination.h"
#include "core/index/ball_tree.h"

namespace stellate::core {

// Of manifolds with boundary: that the mesh ends at all pieces of each wall, and not only at those
// that the refinement came upon. From inside of the mesh each wall is asked for its closest point;
// where that is in M, a simplex of the wall's mesh has to be near, and to face as the wall does: a
// second sheet close to the first, a void just under the skin, faces the other way.
class SheetClaims {
 public:
  // `ends`, `clear`: what is known, borrowed; answers on walls are added to the ends.
  SheetClaims(Examination& examination, BoundaryClaims& boundary, EndsOfManifold& ends,
              const ClearPoints& clear);

  // A block for each wall: barycentres of some of the `chosen` simplices. What lies deep inside is
  // asked about once: a closest point that far away leaves no room for others in between.
  std::vector<QueryBlock> Questions(const std::vector<std::uint32_t>& chosen);
  // The answers to one of these, or to others of points on that wall alone.
  void Judge(std::size_t wall, const Eigen::MatrixXd& asked, const AnswerBlock& answer);

  // The ends that were known before.
  void JudgeKnown();

  // A block for each wall: those points that became known since the last call, or before the first,
  // that are much less clear of it than points near them are, by their distance from its mesh. What
  // is that near to a second sheet may not have been asked about: a solver's "closest" point of the
  // wall may be far beyond others, and then a ball up to it is not empty.
  std::vector<QueryBlock> QuestionsWhereClearancesDip();

 private:
  // The mesh of a wall.
  struct Sheet {
    explicit Sheet(int d) : tree(d, &barycentres) {}
    Sheet(Sheet&&) = delete;  // the tree borrows the barycentres

    std::vector<std::uint32_t> simplices;  // k ids each
    std::vector<double> barycentres;       // d each
    std::vector<double> outward;           // d each: out of the mesh, within the tangent space of
                                           // the simplex that ends there
    std::vector<double> radii;             // around the barycentres
    double largest_radius = 0;
    BallTree tree;  // of the barycentres, by these radii
    // By clear point: its clearance over its distance from the mesh; 0: so near to that it tells
    // nothing, or on the wall.
    std::vector<double> shares;
  };
  std::unique_ptr<Sheet> SheetOf(int wall) const;
  Eigen::VectorXd OutwardAt(const std::uint32_t* facet) const;
  std::vector<std::uint32_t> Spread(const Sheet& sheet, const Eigen::MatrixXd& barycentres,
                                    const std::vector<double>& radii) const;
  double DistanceFrom(const Sheet& sheet, const double* y) const;
  void TakeShares(std::size_t wall);
  std::vector<std::uint32_t> Dips(const Sheet& sheet, const BallTree& tree) const;
  QueryBlock QuestionsOf(std::size_t wall, Eigen::MatrixXd points) const;
  // A point of M on a wall, and the conormal there, d each; borrowed.
  struct End {
    const double* y;
    const double* conormal;
  };
  std::optional<std::uint32_t> NearestThatEnds(const Sheet& sheet, const End& end) const;
  void Hold(std::size_t wall, const std::vector<End>& ends);

  Examination& x_;
  BoundaryClaims& boundary_;
  std::vector<std::unique_ptr<Sheet>> sheets_;  // by wall
  EndsOfManifold& ends_;
  const ClearPoints& clear_;
  std::size_t looked_at_ = 0;  // clear points whose dips were asked about
};

}  // namespace stellate::core
