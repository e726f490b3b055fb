#include "server/memory/machine.h"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <thread>

#include "server/memory/cgroup.h"

namespace stellate::server {
namespace {

std::uint64_t PageBytes() { return static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)); }

}  // namespace

std::uint64_t MachineBytes() {
  const auto machine = static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) * PageBytes();
  return std::min(machine, CgroupMemoryLimit().value_or(machine));
}

std::size_t MachineProcessors() {
  cpu_set_t allowed;
  const bool is_known = sched_getaffinity(0, sizeof allowed, &allowed) == 0;  // below 1,024 of them
  const std::size_t machine = is_known ? static_cast<std::size_t>(CPU_COUNT(&allowed))
                                       : std::thread::hardware_concurrency();
  const double quota = CgroupProcessors().value_or(static_cast<double>(machine));
  return std::max<std::size_t>(1, std::min(machine, static_cast<std::size_t>(std::ceil(quota))));
}

std::uint64_t ResidentBytes() {
  std::uint64_t size = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> size >> resident;
  return resident * PageBytes();
}

}  // namespace stellate::server
