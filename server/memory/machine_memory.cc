#include "server/memory/machine_memory.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "server/memory/cgroup.h"

namespace stellate::server {
namespace {

std::uint64_t PageBytes() { return static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)); }

}  // namespace

std::uint64_t MachineBytes() {
  const auto machine = static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) * PageBytes();
  return std::min(machine, CgroupMemoryLimit().value_or(machine));
}

std::uint64_t ResidentBytes() {
  std::uint64_t size = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> size >> resident;
  return resident * PageBytes();
}

}  // namespace stellate::server
