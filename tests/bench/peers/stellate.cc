#include <memory>
#include <stdexcept>

#include "core/mesher.h"
#include "stellate/catalogue.h"
#include "tests/bench/peers/peer.h"
#include "tests/support/run_mesher.h"

namespace stellate::bench {

Outcome MeshWithStellate(const Task& task, Meter& meter) {
  std::string error;
  const std::unique_ptr<Manifold> manifold = MakeManifold(task.manifold, &error);
  if (manifold == nullptr) throw std::runtime_error(error);
  core::Specification spec = stellate::testing::SpecificationFor(*manifold, task.size);
  spec.threads = 1;
  if (task.radius_edge_bound > 0) spec.criteria.radius_edge_bound = task.radius_edge_bound;

  Outcome outcome;
  meter.Start();
  auto mesher = core::Mesher::Create(spec);
  if (!mesher) throw std::runtime_error(mesher.error().message);
  double refined = ProcessorSeconds();  // when the last round that inserted points was over
  while (const core::QueryBatch* batch = (*mesher)->NextBatch()) {
    const double asked = ProcessorSeconds();
    const core::Answers answers = stellate::testing::AnswersOf(*manifold, *batch);
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
