#pragma once

#include <ctime>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/mesher.h"
#include "stellate/oracle.h"
#include "tests/support/make_manifold.h"

namespace stellate::testing {

// What a finished run leaves, and the processor time (this process, all threads) of each side.
struct FinishedRun {
  core::Specification spec;
  core::Report report;
  Eigen::MatrixXd points;                // d x n
  std::vector<std::uint32_t> simplices;  // k+1 each
  double mesher_seconds = 0;
  double oracle_seconds = 0;
};

inline double ProcessorSeconds() {
  return static_cast<double>(std::clock()) / static_cast<double>(CLOCKS_PER_SEC);
}

// What a client would declare of `oracle`, except its sizes.
inline core::Specification SpecificationFor(const Oracle& oracle, double epsilon) {
  core::Specification spec;
  spec.dimension = oracle.dimension();
  spec.ambient_dimension = oracle.ambient_dimension();
  spec.epsilon = epsilon;
  spec.oracle.intersect_flat = oracle.has_intersect_flat();
  spec.oracle.tangent_basis = oracle.has_tangent_basis();
  spec.walls = oracle.walls();
  spec.oracle.conormals = oracle.walls() > 0;
  if (const auto box = oracle.bounding_box()) {
    spec.bounding_box = core::BoundingBox{box->lower, box->upper};
  }
  spec.seeds = oracle.seeds();
  return spec;
}

inline core::Answers AnswersOf(Oracle& oracle, const core::QueryBatch& batch) {
  core::Answers answers;
  for (const core::QueryBlock& block : batch.blocks) {
    Walls face;
    core::ForEachWall(block.face, [&face](int wall) { face.push_back(wall); });
    Answer answer = block.kind != core::QueryKind::kClosestPoint
                        ? oracle.IntersectFlat(block.points, block.bases, block.radii)
                    : face.empty() ? oracle.ClosestPoint(block.points)
                                   : oracle.FacePoint(block.points, face);
    if (block.want.tangents && answer.tangents.size() == 0) {
      answer.tangents = oracle.TangentBasis(answer.points);
    }
    if (block.want.sizes && answer.sizes.size() == 0) {
      answer.sizes = oracle.LocalSize(answer.points);
    }
    if (block.want.clearances) {
      answer.clearances = oracle.Clearances(answer.points);
      if (!face.empty()) answer.conormals = oracle.Conormals(answer.points, face);
    }
    answers.blocks.push_back({std::move(answer.points), std::move(answer.found),
                              std::move(answer.tangents), std::move(answer.sizes),
                              std::move(answer.clearances), std::move(answer.conormals)});
  }
  return answers;
}

// Meshes `oracle` in this process. Throws std::runtime_error with the mesher's own words when it
// refuses the specification or an answer.
inline FinishedRun RunMesher(Oracle& oracle, core::Specification spec,
                             core::Execution execution = {}) {
  FinishedRun run;
  run.spec = spec;
  auto mesher = core::Mesher::Create(std::move(spec), execution);
  if (!mesher) throw std::runtime_error(mesher.error().message);
  const double start = ProcessorSeconds();
  while (const auto batch = (*mesher)->NextBatch()) {
    const double asked = ProcessorSeconds();
    const core::Answers answers = AnswersOf(oracle, *batch);
    run.oracle_seconds += ProcessorSeconds() - asked;
    const auto delta = (*mesher)->Absorb(answers);
    if (!delta) throw std::runtime_error(delta.error().message);
  }
  run.mesher_seconds = ProcessorSeconds() - start - run.oracle_seconds;
  run.report = (*mesher)->report();
  run.points = (*mesher)->Points();
  run.simplices = (*mesher)->Simplices();
  return run;
}

// Meshes a manifold of the catalogue.
inline FinishedRun RunMesher(const std::string& manifold, double epsilon) {
  const std::unique_ptr<Manifold> oracle = Make(manifold);
  return RunMesher(*oracle, SpecificationFor(*oracle, epsilon));
}

}  // namespace stellate::testing
