#pragma once

#include <cstddef>

#include "core/base/function_ref.h"
#include "core/base/interruption.h"

namespace stellate::core {

// Runs work() with at most that many threads in each ParallelFor in it; 0: all cores. Returns false
// if it was interrupted at any point.
//
//   if (!WithThreads(4, interruption, [&] { Refine(); })) return;  // interrupted
//
// Each call has a oneTBB arena of its own. Arenas are kept and reused: oneTBB leaves the clean-up
// of one that had work to its own threads, and while these are busy elsewhere every released arena
// stays in memory.
bool WithThreads(int threads, Interruption& interruption, FunctionRef<void()> work);

// Returns the number of this process's arenas: the most that were ever in use at the same time.
std::size_t ArenaCount();

}  // namespace stellate::core
