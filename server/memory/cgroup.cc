#include "server/memory/cgroup.h"

#include <algorithm>
#include <fstream>
#include <sstream>
#include <string_view>
#include <vector>

namespace stellate::server {
namespace {

constexpr char kVersion1[] = "cgroup";
constexpr char kVersion2[] = "cgroup2";

bool Lists(std::string_view words, std::string_view word) {
  while (!words.empty()) {
    const std::size_t end = std::min(words.find(','), words.size());
    if (words.substr(0, end) == word) return true;
    words.remove_prefix(std::min(end + 1, words.size()));
  }
  return false;
}

// Where the groups of a controller are mounted.
struct Mount {
  std::string group;  // that is seen at `point`
  std::string point;
  bool version_1 = false;
};

std::vector<Mount> FindMounts(const std::string& root, std::string_view controller) {
  std::vector<Mount> mounts;
  std::ifstream file(root + "/proc/self/mountinfo");
  for (std::string line; std::getline(file, line);) {
    Mount mount;
    std::string word, type, source, options;
    std::istringstream words(line);
    words >> word >> word >> word >> mount.group >> mount.point;
    while (words >> word && word != "-") continue;
    words >> type >> source >> options;
    mount.version_1 = type == kVersion1;
    if (type == kVersion2 || (mount.version_1 && Lists(options, controller))) {
      mounts.push_back(std::move(mount));
    }
  }
  return mounts;
}

// The group of this process in the hierarchy of that version.
std::string FindGroup(const std::string& root, bool version_1, std::string_view controller) {
  std::ifstream file(root + "/proc/self/cgroup");
  for (std::string line; std::getline(file, line);) {
    const std::size_t first = line.find(':');
    const std::size_t second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string_view controllers(line.data() + first + 1, second - first - 1);
    if (version_1 ? Lists(controllers, controller) : controllers.empty()) {
      return line.substr(second + 1);
    }
  }
  return "/";
}

// Calls visit(folder, version_1) with the folder of each group of this process, from the innermost
// on.
template <typename Visit>
void VisitGroups(const std::string& root, std::string_view controller, Visit visit) {
  for (const Mount& mount : FindMounts(root, controller)) {
    std::string group = FindGroup(root, mount.version_1, controller);
    // A container may see its own group as the root of all, and be told its path from outside.
    if (mount.group != "/") {
      group = group.starts_with(mount.group + "/") ? group.substr(mount.group.size()) : "";
    }
    while (true) {
      while (group.ends_with('/')) group.pop_back();
      std::string folder = root + mount.point;
      folder += group;
      visit(folder, mount.version_1);
      if (group.empty()) break;
      group.erase(group.rfind('/') == std::string::npos ? 0 : group.rfind('/'));
    }
  }
}

void TakeLess(std::istream& file, std::optional<std::uint64_t>* least) {
  std::uint64_t limit = 0;  // "max" is no number
  if (file >> limit) *least = std::min(limit, least->value_or(limit));
}

// Of groups that lie outside a container and cannot be seen from within.
void TakeLessOfAncestors(const std::string& path, std::optional<std::uint64_t>* least) {
  std::ifstream file(path);
  for (std::string word; file >> word;) {
    if (word == "hierarchical_memory_limit") return TakeLess(file, least);
  }
}

}  // namespace

std::optional<std::uint64_t> CgroupMemoryLimit(const std::string& root) {
  std::optional<std::uint64_t> least;
  VisitGroups(root, "memory", [&least](const std::string& folder, bool version_1) {
    std::ifstream file(folder + (version_1 ? "/memory.limit_in_bytes" : "/memory.max"));
    TakeLess(file, &least);
    if (version_1) TakeLessOfAncestors(folder + "/memory.stat", &least);
  });
  return least;
}

std::optional<double> CgroupProcessors(const std::string& root) {
  std::optional<double> least;
  VisitGroups(root, "cpu", [&least](const std::string& folder, bool version_1) {
    // Microseconds of processor time in each period; version 2 has "max" for no quota, version 1
    // -1.
    double quota = 0, period = 0;
    if (version_1) {
      std::ifstream(folder + "/cpu.cfs_quota_us") >> quota;
      std::ifstream(folder + "/cpu.cfs_period_us") >> period;
    } else {
      std::ifstream(folder + "/cpu.max") >> quota >> period;
    }
    if (quota > 0 && period > 0) least = std::min(quota / period, least.value_or(quota / period));
  });
  return least;
}

}  // namespace stellate::server
