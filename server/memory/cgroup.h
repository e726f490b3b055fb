#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace stellate::server {

// The least memory, in bytes, that any control group of this process allows: its own and those
// around it, of either version. Nothing where none has a limit. `root` stands before each path that
// is read (/proc/self/cgroup, /proc/self/mountinfo, and where they say that groups are mounted).
std::optional<std::uint64_t> CgroupMemoryLimit(const std::string& root = "");

// The least number of processors that any of them lets it use in the mean, as 1.5. Nothing where
// none has a quota.
std::optional<double> CgroupProcessors(const std::string& root = "");

}  // namespace stellate::server
