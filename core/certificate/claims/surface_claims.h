#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/base/function_ref.h"
#include "core/batch.h"
#include "core/certificate/claims/examination.h"

namespace stellate::core {

// The claims about a boundary without its inside: the surface of each region is closed, its links
// are spheres, and its simplices agree about what is outside. Where the signs of walls say that a
// region touches itself in an edge or a point alone, its surface is taken apart there first.
class SurfaceClaims {
 public:
  explicit SurfaceClaims(Examination& examination) : x_(examination) {}

  // Judges the complex, and measures it. Returns false if there is nothing to judge.
  bool Judge();

  // Returns a block for each wall: some vertices that are on it alone, which are their own closest
  // points. They measure the oracle's error.
  std::vector<QueryBlock> VertexQuestions() const;
  void JudgeVertices(const Eigen::MatrixXd& asked, const AnswerBlock& answer);
  // Returns points beside the boundary and all over its box, d x n, from which to look for pieces
  // of walls that the mesh lacks.
  Eigen::MatrixXd PointsBeside() const;

 private:
  using Ids = std::array<std::uint32_t, kMaxDimension>;
  // A simplex of the boundary.
  struct Row {
    const std::uint32_t* ids;  // k
    const double* conormals;   // d at each vertex
    WallSet wall, signs;       // signs: of all other walls
    int below, above, behind;  // labels
    // The signs of all walls on the side of a region.
    WallSet Towards(int label) const { return above == label ? signs | wall : signs; }
  };
  // Two simplices of a region's surface that are neighbours there, by the places of the vertices
  // that they do not share.
  struct Neighbours {
    std::uint32_t a, b;
    int a_place, b_place;
  };

  void TakeRows();
  double JudgeRegion(int label);
  // Counts the components of M, if it fills space and their least number is declared.
  void JudgeComponents();
  // Returns what some of the simplices enclose; 0 if M does not fill space.
  double VolumeWithin(FunctionRef<bool(const Row&)> is_of_it,
                      FunctionRef<bool(const Row&)> faces_inwards) const;
  std::vector<Neighbours> NeighboursIn(const std::vector<std::uint32_t>& surface, int label) const;
  std::vector<std::uint32_t> TakenApart(const std::vector<std::uint32_t>& surface, int label,
                                        const std::vector<Neighbours>& neighbours,
                                        std::vector<std::uint32_t>* copied);
  std::size_t PiecesAt(std::uint32_t v, int label) const;
  bool AreTurnedAlike(int label, const std::vector<Neighbours>& neighbours) const;
  void Measure();
  double TiltAt(const Row& row, int place) const;

  Examination& x_;
  std::vector<Row> rows_;
};

}  // namespace stellate::core
