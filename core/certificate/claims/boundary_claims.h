#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/batch.h"
#include "core/certificate/claims/closed_off.h"
#include "core/certificate/claims/examination.h"

namespace stellate::core {

// The claim that a mesh with boundary ends where its faces are, and only there.
class BoundaryClaims {
 public:
  explicit BoundaryClaims(Examination& examination) : x_(examination) {}

  // Fills the certificate's report of each face, and of the boundary.
  void ReportFaces();
  // The same, and checks that the boundary itself is a closed manifold. `closed`: all of M,
  // closed off.
  void JudgeFaces(const ClosedOff& closed);

  // Measures M, and checks that its simplices fill what its boundary encloses.
  void JudgeVolume();

  // Returns barycentres of some simplices of the boundary, a block for each wall. JudgeFace takes
  // the answers to one block.
  std::vector<QueryBlock> FaceQuestions();
  void JudgeFace(std::size_t block, const Eigen::MatrixXd& asked, const AnswerBlock& answer);
  // Checks that no simplex lies beyond a wall that it does not touch. `chosen`, `each`: see
  // PointsInside.
  void JudgeInside(const std::vector<std::uint32_t>& chosen, std::uint32_t each,
                   const AnswerBlock& answer);
  // Checks closest points on M^: refuses the mesh if one near it is beyond a wall at which the mesh
  // does not end.
  void JudgeBeyond(const AnswerBlock& answer);
  // Bounds the boundary's reach by an answered point y (d) of the wall near the simplex `ids` (k)
  // of its mesh. REQUIRES: the oracle's position error is known.
  void TakePoint(int wall, const std::uint32_t* ids, const double* y);
  // Checks that the boundary's own reach within M, as its edges and answers bound it, is not too
  // small for the mesh. REQUIRES: M's own reach has been judged.
  void JudgeReach();

 private:
  void TakeAt(WallSet walls, std::uint32_t p, const double* q);

  Examination& x_;
  std::vector<std::vector<std::uint32_t>> chosen_;  // by block: places in its face
  std::vector<const FaceMesh*> faces_;              // by block
  // The least bound of the boundary's reach so far, the vertex where it was found, and its walls;
  // and the largest ratio of the mesh size to it.
  double reach_ = INFINITY, ratio_ = 0;
  std::uint32_t narrowest_ = 0;
  WallSet narrowest_walls_ = 0;
};

}  // namespace stellate::core
