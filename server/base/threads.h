#pragma once

#include <cstddef>

#include "core/status.h"

namespace stellate::server {

// Threads that a server has when it has no mesh, and some to spare: gRPC makes more of its own on a
// machine with many processors.
std::size_t LeastThreads();

// Ok if this process may have `count` more threads; else kFailedPrecondition, and what to do. They
// are made, and gone again when this returns. To be asked before any library makes its own, since
// those would abort, or go on without.
core::Status CheckThreads(std::size_t count);

}  // namespace stellate::server
