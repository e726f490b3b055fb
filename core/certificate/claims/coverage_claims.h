#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/batch.h"
#include "core/certificate/claims/examination.h"
#include "core/certificate/evidence/evidence.h"
#include "core/certificate/evidence/fibres.h"
#include "core/certificate/evidence/undeclared_boundary_check.h"

namespace stellate::core {

// That the mesh is all of M, once: normal flats at points of M, some near the mesh and some
// anywhere, meet it once and near; and whatever was answered has a vertex near.
class CoverageClaims {
 public:
  CoverageClaims(Examination& examination, UndeclaredBoundaryCheck& boundary_check)
      : x_(examination), boundary_check_(boundary_check) {}

  Eigen::MatrixXd ProbeQuestions() const;
  void JudgeProbes(const Eigen::MatrixXd& asked, const AnswerBlock& answer);
  // Where the oracle gives no tangents: differences around the probes' closest points.
  Eigen::MatrixXd DifferenceQuestions() const;
  void JudgeDifferences(const AnswerBlock& answer);

  // All that is seen by now, against the mesh.
  Evidence JudgeSeen();

 private:
  // A point of M that the mesh must cover.
  struct Probe {
    Eigen::VectorXd x;
    NearestVertex nearest;
    std::vector<double> tangent;  // k x d, C order
  };
  void JudgeFibres();
  bool IsBeyondFacet(const Eigen::VectorXd& x, std::uint32_t vertex) const;
  void JudgeHits(const Probe& probe, const FibreHits& hits);
  void Fail(const Probe& probe);

  Examination& x_;
  UndeclaredBoundaryCheck& boundary_check_;
  std::vector<Probe> probes_;  // until their fibres are judged
};

}  // namespace stellate::core
