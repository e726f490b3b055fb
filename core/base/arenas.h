#pragma once

#include <cstddef>

#include "core/base/function_ref.h"
#include "core/base/interruption.h"

namespace stellate::core {

// Runs work() so that the ParallelFor in it use at most that many threads; 0: all cores. False if
// it was interrupted, at any point.
//
// Each call has an arena of oneTBB's to itself. Arenas are kept and used again: oneTBB leaves the
// clean-up of one that had work to its own threads, and while these are busy elsewhere every arena
// given up stays in memory for good.
bool WithThreads(int threads, Interruption& interruption, FunctionRef<void()> work);

// The arenas of this process: the most that were ever in use at the same time.
std::size_t ArenaCount();

}  // namespace stellate::core
