#pragma once

#include <memory>
#include <vector>

#include "core/batch.h"
#include "core/certificate/mesh_view.h"
#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {

// What a Certifier does round by round: see there.
class CertifierRounds {
 public:
  virtual ~CertifierRounds() = default;

  virtual const std::vector<QueryBlock>* NextBlocks() const = 0;
  virtual void Absorb(const std::vector<AnswerBlock>& answers) = 0;
  virtual const Certificate& certificate() const = 0;
  virtual const std::vector<double>& wanted() const = 0;
  virtual const PointsOnWalls& wanted_on_walls() const = 0;
  virtual KnownOfManifold TakeKnown() = 0;
};

// Returns those for a boundary without its inside (Specification::boundary_only).
std::unique_ptr<CertifierRounds> RoundsForBoundary(const Specification& spec, const MeshView& mesh,
                                                   const StarFacts& facts, KnownOfManifold known);

}  // namespace stellate::core
