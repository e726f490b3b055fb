#pragma once

#include <cstddef>

#include "core/status.h"

namespace stellate::server {

// The threads of a server without a mesh, and a reserve: gRPC creates more on a machine with many
// processors.
std::size_t LeastThreads();

// Ok if this process may create `count` more threads; else kFailedPrecondition, and what to do.
// Creates and ends them. Call it before any library creates its own, since those would abort, or go
// on without.
core::Status CheckThreads(std::size_t count);

}  // namespace stellate::server
