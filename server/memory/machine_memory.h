#pragma once

#include <cstdint>

namespace stellate::server {

// The memory that this process may use, in bytes: the machine's, or the limit of a control group if
// that is less.
std::uint64_t MachineBytes();
// The memory that this process uses, in bytes; 0: unknown.
std::uint64_t ResidentBytes();

}  // namespace stellate::server
