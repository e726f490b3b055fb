#include "server/session/progress_history.h"

#include <algorithm>

namespace stellate::server {

void ProgressHistory::Add(const PastProgress& past) {
  if (!all_.empty() && all_.back().revision % step_ != 0) all_.pop_back();
  all_.push_back(past);
  if (all_.size() < kMost) return;
  step_ *= 2;
  const PastProgress newest = all_.back();
  all_.pop_back();
  std::erase_if(all_, [this](const PastProgress& p) { return p.revision % step_ != 0; });
  all_.push_back(newest);
}

std::vector<PastProgress> ProgressHistory::After(std::uint64_t revision) const {
  const auto first =
      std::upper_bound(all_.begin(), all_.end(), revision,
                       [](std::uint64_t r, const PastProgress& p) { return r < p.revision; });
  return {first, all_.end()};
}

}  // namespace stellate::server
