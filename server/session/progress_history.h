#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/report.h"

namespace stellate::server {

// How a mesh stood at one of its revisions.
struct PastProgress {
  std::uint64_t revision = 0;
  core::Progress progress;
  double elapsed_seconds = 0;  // since creation; 0: unknown
};

// How a mesh stood at each of its revisions. Memory is bounded: once there are kMost, every second
// is forgotten, and from then on only every second revision is kept, and so on. The newest is
// always there.
class ProgressHistory {
 public:
  static constexpr std::size_t kMost = 4096;

  // Revisions ascend.
  void Add(const PastProgress& past);
  // Of revisions after this one, ascending.
  std::vector<PastProgress> After(std::uint64_t revision) const;

  const std::vector<PastProgress>& all() const { return all_; }

 private:
  std::vector<PastProgress> all_;
  std::uint64_t step_ = 1;  // but for the newest, only multiples of it are kept
};

}  // namespace stellate::server
