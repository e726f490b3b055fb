#pragma once

#include "core/reconstruction.h"

namespace stellate::core {

// Reconstruct, of a specification and a cloud that were validated. Throws Interrupted.
Expected<Reconstruction> ReconstructCloud(const ReconstructionSpecification& spec,
                                          const PointCloud& cloud, ReconstructionWatch* watch);

}  // namespace stellate::core
