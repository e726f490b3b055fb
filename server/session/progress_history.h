#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/report.h"

namespace stellate::server {

// The progress of a mesh at one revision.
struct PastProgress {
  std::uint64_t revision = 0;
  core::Progress progress;
  double elapsed_seconds = 0;  // since creation; 0: unknown
};

// The progress of a mesh at its revisions. Memory is bounded: beyond kMost revisions it keeps only
// every second one, then every fourth, and so on, and always the newest.
class ProgressHistory {
 public:
  static constexpr std::size_t kMost = 4096;

  // REQUIRES: revisions ascend.
  void Add(const PastProgress& past);
  // Returns those of later revisions, ascending.
  std::vector<PastProgress> After(std::uint64_t revision) const;

  const std::vector<PastProgress>& all() const { return all_; }

 private:
  std::vector<PastProgress> all_;
  std::uint64_t step_ = 1;  // only multiples of it are kept, and the newest
};

}  // namespace stellate::server
