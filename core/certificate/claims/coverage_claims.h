#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/batch.h"
#include "core/certificate/claims/examination.h"
#include "core/certificate/evidence/evidence.h"
#include "core/certificate/evidence/fibres.h"
#include "core/certificate/evidence/undeclared_boundary_check.h"

namespace stellate::core {

// The claim that the mesh covers all of M, once: normal flats at points of M, some near the mesh
// and some anywhere, meet the mesh once and nearby, and every answered point has a vertex near.
class CoverageClaims {
 public:
  CoverageClaims(Examination& examination, UndeclaredBoundaryCheck& boundary_check)
      : x_(examination), boundary_check_(boundary_check) {}

  Eigen::MatrixXd ProbeQuestions() const;
  void JudgeProbes(const Eigen::MatrixXd& asked, const AnswerBlock& answer);
  // Returns steps around the probes' closest points whose tangent spaces are not known yet: the
  // differences give them. Empty if there are none.
  Eigen::MatrixXd DifferenceQuestions() const;
  void JudgeDifferences(const AnswerBlock& answer);

  // Compares all points of M that were answered so far with the mesh.
  Evidence JudgeSeen();

 private:
  // A point of M that the mesh must cover.
  struct Probe {
    Eigen::VectorXd x;
    NearestVertex nearest;
    std::vector<double> tangent;  // k x d, C order
    bool knows_tangent = false;   // or it is the nearest vertex's
    Eigen::VectorXd asked;        // where the query was that found it
  };
  void ReadTangent(Probe* probe) const;
  void NoteOffset(const Probe& probe);
  Eigen::MatrixXd TangentsNear(const Probe& probe) const;
  void JudgeFibres();
  bool IsBeyondFacet(const Eigen::VectorXd& x, std::uint32_t vertex) const;
  void JudgeHits(const Probe& probe, const FibreHits& hits);
  void Fail(const Probe& probe);

  Examination& x_;
  UndeclaredBoundaryCheck& boundary_check_;
  std::vector<Probe> probes_;  // until their fibres are judged
};

}  // namespace stellate::core
