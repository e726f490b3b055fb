#pragma once

#include "core/status.h"

namespace stellate::core {

// How a mesh is computed. It changes no bit of the mesh; what does is in Specification.
//
//   auto mesher = Mesher::Create(spec, {.threads = 4});
struct Execution {
  int threads = 0;  // 0: all cores
};

// Returns kInvalidArgument with the offending field and value, else Ok.
Status Validate(const Execution& execution);

}  // namespace stellate::core
