#pragma once

#include <cstddef>
#include <cstdint>

namespace stellate::server {

// The memory that this process may use, in bytes: the machine's, or the limit of a control group if
// that is less.
std::uint64_t MachineBytes();
// How many processors this process may use at a time: those of the machine that it may run on, or
// what the quota of a control group amounts to if that is less; 1 at least.
std::size_t MachineProcessors();
// The memory that this process uses, in bytes; 0: unknown.
std::uint64_t ResidentBytes();

}  // namespace stellate::server
