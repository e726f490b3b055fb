#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/certificate/mesh_view.h"
#include "core/report.h"

namespace stellate::core {

// How well a finished mesh is protected, measured on its vertices and tangent spaces alone;
// docs/using/protection.md has the theorems and their proofs.

// What is known of the mesh and of M.
struct ProtectionFacts {
  double asked = 0;  // the gap that was asked for, length
  CentreRule centre_rule = CentreRule::kTangentSpace;
  // A lower bound r of M's reach that the mesh was proved from, length. Infinity: none.
  double reach = INFINITY;
  // With it: no point of the components of M that the mesh meets is farther from a vertex.
  double cover = 0;
};

// The simplex that is the farthest from what the theorem of complexes asks of it.
struct WorstPlace {
  std::uint32_t simplex = 0;
  double gap = 0, needed = 0;  // lengths; needed is infinity where it is too large for the reach
};

struct ProtectionFindings {
  ProtectionReport report;
  std::optional<WorstPlace> worst;  // none: the theorem holds, or there is no reach
};

// REQUIRES: k <= 3, and the mesh is a closed manifold whose stars embed. Time O(n log n).
ProtectionFindings MeasureProtection(const MeshView& mesh, const ProtectionFacts& facts);

}  // namespace stellate::core
