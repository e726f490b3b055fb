// What a run reports of its ending.

#include "core/base/message.h"
#include "core/certificate/findings.h"
#include "core/run/ending.h"
#include "core/run/meshing_run.h"

namespace stellate::core {

template <int K>
void MeshingRun<K>::DescribeEnding(bool is_whole) {
  const Termination termination = report_.termination;
  Certificate& certificate = report_.certificate;
  if (termination == Termination::kConverged) {
    certificate = certification_->certificate();
    WarnOfCompromises<K>(engine_, spec_.epsilon, &certificate);
    // It may be the cause of all other problems.
    if (crease_probe_.crease()) {
      certificate.verdict = Message("Not certified: ", DescribeCrease(*crease_probe_.crease()));
      certificate.only_too_coarse = false;
    }
  } else {
    certificate.verdict = Message("not certified: the run ended as ", TerminationName(termination),
                                  certification_ ? " when every rule held, before it was certified"
                                                 : " before every rule held");
    if (!report_.failure.message.empty()) certificate.verdict += ": " + report_.failure.message;
    if (termination == Termination::kVertexBudget)
      certificate.verdict += ": allow more vertices (max_vertices), or take a larger epsilon";
    if (termination == Termination::kRoundBudget)
      certificate.verdict += ": allow more rounds (max_rounds)";
    // A client that cancels a large mesh does not want to wait for its description.
    if (termination != Termination::kCancelled && termination != Termination::kOracleFailed)
      DescribeUnfinished<K>(engine_, spec_.epsilon, !crease_probe_.crease(), &certificate);
    if (termination == Termination::kNoProgress)
      certificate.verdict +=
          "; " + (box_watch_.has_left() ? box_watch_.WhyStopped()
                  : crease_probe_.crease()
                      ? DescribeCrease(*crease_probe_.crease())
                      : WhatIsLeft<K>(engine_, certificate.inconsistent_simplices) +
                            boundary_detector_.Describe(engine_.stars().sample().d()));
    // A front that never closes may be where the manifold ends.
    const bool spent =
        termination == Termination::kVertexBudget || termination == Termination::kRoundBudget;
    if (spec_.walls == 0 && !box_watch_.has_left() && !crease_probe_.crease() &&
        (termination == Termination::kNoProgress ||
         (spent && !boundary_detector_.offsets().empty())))
      certificate.verdict += Message(". ", kDeclareWalls);
  }
  if (!is_whole) return;
  box_watch_.Warn(&certificate);
  if (spec_.walls == 0) return;
  if (termination == Termination::kNoProgress)
    ExplainInactiveWall<K>(engine_, spec_.walls, &certificate);
  ExplainNearCorners<K>(engine_, spec_.epsilon, &certificate);
  if (termination == Termination::kConverged || termination == Termination::kNoProgress)
    ExplainWallCurvature<K>(engine_, spec_.epsilon, lacks_.piece, &certificate);
  ExplainSharpest<K>(engine_, &certificate);
}

#define STELLATE_EACH(K) template void MeshingRun<K>::DescribeEnding(bool);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
