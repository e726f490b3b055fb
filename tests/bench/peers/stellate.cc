#include <memory>
#include <stdexcept>
#include <vector>

#include "core/mesher.h"
#include "stellate/oracles/walls.h"
#include "tests/bench/peers/peer.h"
#include "tests/bench/peers/quality.h"
#include "tests/support/make_manifold.h"
#include "tests/support/run_mesher.h"

namespace stellate::bench {

Outcome MeshWithStellate(const Task& task, Meter& meter) {
  const std::shared_ptr<Manifold> manifold = testing::Make(task.manifold);
  std::shared_ptr<Oracle> oracle = manifold;
  if (task.clip) {
    oracle = std::make_shared<oracles::Clipped>(
        oracle, std::vector{oracles::HalfSpace(PoleOf(*manifold), *task.clip)});
  }
  core::Specification spec = stellate::testing::SpecificationFor(*oracle, task.size);
  if (task.radius_edge_bound > 0) spec.criteria.radius_edge_bound = task.radius_edge_bound;

  Outcome outcome;
  meter.Start();
  auto mesher = core::Mesher::Create(spec, {.threads = 1});
  if (!mesher) throw std::runtime_error(mesher.error().message);
  double refined = ProcessorSeconds();  // when the last round that inserted points was over
  while (const auto batch = (*mesher)->NextBatch()) {
    const double asked = ProcessorSeconds();
    const core::Answers answers = stellate::testing::AnswersOf(*oracle, *batch);
    outcome.oracle_seconds += ProcessorSeconds() - asked;
    const auto delta = (*mesher)->Absorb(answers);
    if (!delta) throw std::runtime_error(delta.error().message);
    if ((*mesher)->progress().phase == core::Phase::kRefining) refined = ProcessorSeconds();
  }
  outcome.certificate_seconds = ProcessorSeconds() - refined;
  outcome.simplices = (*mesher)->Simplices();
  meter.Stop();

  outcome.points = (*mesher)->Points();
  const core::Report& report = (*mesher)->report();
  outcome.evaluations = report.counts.queries + report.counts.tangent_queries;
  outcome.note = report.certificate.certified ? "certified" : report.certificate.verdict;
  return outcome;
}

}  // namespace stellate::bench
