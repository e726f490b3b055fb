#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/batch.h"
#include "core/certificate/examination.h"
#include "core/sample/ball_tree.h"

namespace stellate::core {

// Of manifolds with boundary: that the mesh ends at all pieces of each wall, and not only at those
// that the refinement came upon. From inside of the mesh each wall is asked for its closest point;
// where that is in M, a simplex of the wall's mesh has to be near, and to face as the wall does: a
// second sheet close to the first, a void just under the skin, faces the other way.
class SheetClaims {
 public:
  explicit SheetClaims(Examination& examination);

  // A block for each wall: barycentres of some of the `chosen` simplices. What lies deep inside is
  // asked about once: a closest point that far away leaves no room for others in between.
  std::vector<QueryBlock> Questions(const std::vector<std::uint32_t>& chosen);
  // The answers to one.
  void Judge(std::size_t wall, const Eigen::MatrixXd& asked, const AnswerBlock& answer);

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
  };
  std::unique_ptr<Sheet> SheetOf(int wall) const;
  Eigen::VectorXd OutwardAt(const std::uint32_t* facet) const;
  std::vector<std::uint32_t> Spread(const Sheet& sheet, const Eigen::MatrixXd& barycentres,
                                    const std::vector<double>& radii) const;
  bool Ends(const Sheet& sheet, const Eigen::VectorXd& y, const Eigen::VectorXd& conormal) const;

  Examination& x_;
  std::vector<std::unique_ptr<Sheet>> sheets_;  // by wall
};

}  // namespace stellate::core
