#pragma once

#include <cstdint>
#include <vector>

#include "core/certificate/mesh_view.h"
#include "core/places.h"
#include "core/reconstruction.h"

namespace stellate::core {

// What is known of a finished reconstruction besides its mesh.
struct KnownOfPoints {
  const double* given = nullptr;  // the points as they came, and those added, d each; the mesh may
                                  // have moved them
  std::uint64_t added = 0;        // vertices that are none of the points
  std::vector<Place> causes;      // by vertex: kOk, or what the points say against the mesh there
  std::uint64_t against = 0;      // such points
  bool tangents_given = false;
  // The sine of the angle between the mesh's tangent spaces and M's is at most this over the reach,
  // length (DifferenceTangents); 0 where they are given.
  double tangent_error_length = 0;
};

// Writes the certificate of a reconstruction into its report. REQUIRES: Report::reconstruction is
// set.
void JudgeReconstruction(const ReconstructionSpecification& spec, const MeshView& mesh,
                         const KnownOfPoints& known, Report* report);

}  // namespace stellate::core
