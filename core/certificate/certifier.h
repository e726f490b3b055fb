#pragma once

#include <memory>
#include <vector>

#include "core/batch.h"
#include "core/certificate/mesh_view.h"
#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {

// Proves or refutes that a finished mesh is what was asked for. A state machine like Mesher: it
// asks for closest points in a few batches, then holds the certificate.
class Certifier {
 public:
  Certifier(const Specification& spec, const MeshView& mesh, const StarFacts& facts,
            KnownOfManifold known = {});
  ~Certifier();

  // The next closest-point queries, or nullptr when the certificate is complete.
  const std::vector<QueryBlock>* NextBlocks();
  // Answers have passed CheckAnswers.
  void Absorb(const std::vector<AnswerBlock>& answers);
  const Certificate& certificate() const;
  // Once it is complete: points of M, d each, that the mesh has no vertex near, or none near enough
  // for max_deviation. Where there are any it is refused, but may become right when they are
  // inserted.
  const std::vector<double>& Uncovered() const;
  // The same of walls: points of M on walls where the mesh does not end.
  const PointsOnWalls& UncoveredOnWalls() const;
  // All that it knew or was answered, without leans.
  KnownOfManifold TakeKnown();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stellate::core
