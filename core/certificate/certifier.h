#pragma once

#include <memory>
#include <vector>

#include "core/certificate/certifier_rounds.h"
#include "core/certificate/mesh_view.h"
#include "core/query_source.h"
#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {

// Proves or refutes that a finished mesh meets its specification. It queries
// closest points in a few batches, then holds the certificate.
//
//   Certifier certifier(spec, mesh, facts);
//   // ... drive it as a QuerySource, then:
//   if (certifier.certificate().certified) ...
class Certifier final : public QuerySource {
 public:
  Certifier(const Specification& spec, const MeshView& mesh, const StarFacts& facts,
            KnownOfManifold known = {});
  ~Certifier() override;

  std::vector<QueryBlock> Questions() override;
  void Absorb(const std::vector<AnswerBlock>& answers) override;
  const Certificate& certificate() const;
  // Returns the points of M, d each, that have no vertex of the mesh near, or none near enough for
  // max_deviation. If there are any, the mesh is refused, but may become right when they are
  // inserted. REQUIRES: the certificate is complete.
  const std::vector<double>& Uncovered() const;
  // Returns the points of M on walls at which the mesh does not end.
  const PointsOnWalls& UncoveredOnWalls() const;
  // Moves out all points that were known before or came as answers; tangential offsets are left
  // out.
  KnownOfManifold TakeKnown();

 private:
  std::unique_ptr<CertifierRounds> rounds_;
};

}  // namespace stellate::core
