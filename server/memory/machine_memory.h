#pragma once

#include <cstdint>

namespace stellate::server {

// Bytes of memory that this process may have: the machine's, or what a control group allows if
// that is less.
std::uint64_t MachineBytes();
// Bytes of memory that this process has now; 0 where the system does not say.
std::uint64_t ResidentBytes();

}  // namespace stellate::server
