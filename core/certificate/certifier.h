#pragma once

#include <memory>
#include <vector>

#include "core/certificate/mesh_view.h"
#include "core/query_source.h"
#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {

// Proves or refutes that a finished mesh meets its specification. It queries
// closest points in a few batches, then holds the certificate.
//
//   const std::unique_ptr<Certifier> certifier = Certifier::Create(spec, mesh, facts);
//   // ... drive it as a QuerySource, then:
//   if (certifier->certificate().certified) ...
class Certifier : public QuerySource {
 public:
  // The certifier of a whole mesh, or, under Specification::boundary_only, of a boundary without
  // its inside. What `spec` and `mesh` refer to must outlive it.
  static std::unique_ptr<Certifier> Create(const Specification& spec, const MeshView& mesh,
                                           const StarFacts& facts, KnownOfManifold known = {});

  // Complete once there are no more questions.
  virtual const Certificate& certificate() const = 0;
  // Returns the points of M, d each, that have no vertex of the mesh near, or none near enough for
  // max_deviation. If there are any, the mesh is refused, but may become right when they are
  // inserted. REQUIRES: the certificate is complete.
  virtual const std::vector<double>& Uncovered() const = 0;
  // Returns the points of M on walls at which the mesh does not end. REQUIRES: as for Uncovered.
  virtual const PointsOnWalls& UncoveredOnWalls() const = 0;
  // Moves out all points that were known before or came as answers; tangential offsets are left
  // out.
  virtual KnownOfManifold TakeKnown() = 0;

 private:
  static std::unique_ptr<Certifier> CreateForBoundary(const Specification& spec,
                                                      const MeshView& mesh, const StarFacts& facts,
                                                      KnownOfManifold known);
};

}  // namespace stellate::core
