// How a run ends, and what it reports of that.

#include <string>
#include <utility>

#include "core/base/message.h"
#include "core/certificate/findings.h"
#include "core/run/ending.h"
#include "core/run/scheduler.h"

namespace stellate::core {

// Ends the run, once it is known whether a crease, or another dimension of M, keeps it from a
// better end.
template <int K>
void Scheduler<K>::End(Termination termination) {
  const bool may_be_creased = K < spec_.ambient_dimension && !noticed_.box.has_left();
  const bool is_coarse =
      source_.certifier() && source_.certifier()->certificate().epsilon_over_reach > kCoarse;
  if (may_be_creased && !creases_.is_asking()) {
    if (termination == Termination::kNoProgress)
      creases_.ProbeFaults(engine_);
    else if (is_coarse)
      creases_.ProbeAll(engine_.stars());
  }
  if (may_be_creased && (termination == Termination::kNoProgress ||
                         termination == Termination::kVertexBudget || is_coarse))
    creases_.ProbeDimension(engine_);
  if (!may_be_creased || !creases_.is_asking()) return Finish(termination);
  end_.pending = termination;
}

template <int K>
void Scheduler<K>::Fail(Status reason) {
  Finish(Termination::kOracleFailed, std::move(reason));
}

template <int K>
void Scheduler<K>::Finish(Termination termination, Status failure) {
  if (end_.outcome) return;
  end_.outcome = Outcome{termination, std::move(failure), {}};
  // The initial sample has no stars yet.
  if (sample_.is_growing() && termination == Termination::kRoundBudget) CommitSample();
  // The round was absorbed, so that its delta reports the simplices added here.
  if (termination != Termination::kCancelled && termination != Termination::kOracleFailed)
    engine_.CompleteStars(&change_.added, &change_.removed);
  sample_.Drop();
  DescribeEnding();
  source_.Close();
}

template <int K>
void Scheduler<K>::DescribeEnding() {
  const Termination termination = end_.outcome->termination;
  Certificate& certificate = end_.outcome->certificate;
  const std::string flaw = creases_.Describe();
  if (termination == Termination::kConverged) {
    certificate = source_.certifier()->certificate();
    WarnOfCompromises<K>(engine_, spec_.epsilon, &certificate);
    // It may be the cause of all other problems.
    if (!flaw.empty()) {
      certificate.verdict = "Not certified: " + flaw;
      certificate.only_too_coarse = false;
    }
  } else {
    certificate.verdict =
        Message("not certified: the run ended as ", TerminationName(termination),
                source_.certifier() ? " when every rule held, before it was certified"
                                    : " before every rule held");
    if (!end_.outcome->failure.message.empty())
      certificate.verdict += ": " + end_.outcome->failure.message;
    if (termination == Termination::kVertexBudget && !flaw.empty())
      certificate.verdict += ": " + flaw;
    else if (termination == Termination::kVertexBudget)
      certificate.verdict += ": allow more vertices (max_vertices), or take a larger epsilon";
    if (termination == Termination::kRoundBudget)
      certificate.verdict += ": allow more rounds (max_rounds)";
    // A client that cancels a large mesh does not want to wait for its description.
    if (termination != Termination::kCancelled && termination != Termination::kOracleFailed)
      DescribeUnfinished<K>(engine_, spec_.epsilon, flaw.empty(), &certificate);
    if (termination == Termination::kNoProgress)
      certificate.verdict +=
          "; " + (noticed_.box.has_left() ? noticed_.box.WhyStopped()
                  : !flaw.empty()         ? flaw
                                  : WhatIsLeft<K>(engine_, certificate.inconsistent_simplices) +
                                        noticed_.boundary.Describe(engine_.stars().sample().d()));
    // A front that never closes may be where the manifold ends.
    const bool spent =
        termination == Termination::kVertexBudget || termination == Termination::kRoundBudget;
    if (engine_.boundary().policy().MayEndUndeclared() && !noticed_.box.has_left() &&
        flaw.empty() &&
        (termination == Termination::kNoProgress ||
         (spent && !noticed_.boundary.offsets().empty())))
      certificate.verdict += Message(". ", kDeclareWalls);
  }
  if (interruption_.raised()) return;  // the mesh was never reported
  noticed_.box.Warn(&certificate);
  if (termination == Termination::kNoProgress && flaw.empty())
    ExplainInactiveWall<K>(engine_, spec_.walls, &certificate);
  // The one that explains the most leads in the end.
  ExplainSharpest<K>(engine_, termination == Termination::kNoProgress, &certificate);
  if (noticed_.box.has_left()) return;
  ExplainNearCorners<K>(engine_, spec_.epsilon, &certificate);
  if (termination == Termination::kConverged || termination == Termination::kNoProgress)
    ExplainWallCurvature<K>(engine_, spec_.epsilon, noticed_.piece, &certificate);
}

#define STELLATE_EACH(K)                                   \
  template void Scheduler<K>::End(Termination);            \
  template void Scheduler<K>::Fail(Status);                \
  template void Scheduler<K>::Finish(Termination, Status); \
  template void Scheduler<K>::DescribeEnding();
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
