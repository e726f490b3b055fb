#include "core/refinement/violation_index.h"

#include <algorithm>
#include <functional>
#include <numeric>
#include <utility>

#include "core/base/parallel_sort.h"

namespace stellate::core {

template <int K>
void ViolationIndex<K>::Update(std::uint32_t count, const std::vector<std::uint32_t>& judged,
                               std::vector<Entry> entries) {
  is_entered_.resize(count, 0);
  failed_attempts_.resize(count, 0);
  no_flat_.resize(count, 0);
  for (std::size_t i = 0; i < judged.size(); ++i) {
    CheckInterruption(i);
    const std::uint32_t p = judged[i];
    failed_attempts_[p] = no_flat_[p] = is_entered_[p] = 0;
  }
  std::erase_if(size_and_shape_, [&, step = std::size_t{0}](const Entry& entry) mutable {
    CheckInterruption(step++);
    return !is_entered_[entry.star];
  });
  for (const Entry& entry : entries) is_entered_[entry.star] = 1;
  if (size_and_shape_.empty())
    size_and_shape_ = std::move(entries);
  else
    size_and_shape_.insert(size_and_shape_.end(), entries.begin(), entries.end());
  // The initial sample has many.
  if (size_and_shape_.size() < size_and_shape_.capacity() / 4) size_and_shape_.shrink_to_fit();
}

template <int K>
void ViolationIndex<K>::Replace(std::vector<Entry> entries) {
  is_entered_.assign(is_entered_.size(), 0);
  for (const Entry& entry : entries) is_entered_[entry.star] = 1;
  size_and_shape_ = std::move(entries);
}

template <int K>
void ViolationIndex<K>::MarkAllDirty() {
  all_dirty_ = true;
  violating_.clear();
}

template <int K>
void ViolationIndex<K>::MarkDirty(const std::vector<std::uint32_t>& stars) {
  dirty_.insert(dirty_.end(), stars.begin(), stars.end());
}

template <int K>
std::vector<std::uint32_t> ViolationIndex<K>::TakeDirty(const std::vector<std::uint32_t>& others) {
  if (all_dirty_) {
    dirty_.resize(star_count());
    std::iota(dirty_.begin(), dirty_.end(), 0u);
    all_dirty_ = false;
  }
  MarkDirty(violating_);
  MarkDirty(others);
  violating_.clear();
  slivers_ = inconsistent_ = 0;
  std::vector<std::uint32_t> taken;
  taken.swap(dirty_);
  ParallelSort(taken, std::less<>());
  taken.erase(std::unique(taken.begin(), taken.end()), taken.end());
  return taken;
}

// A star that was given up for R1 or R2 is no longer entered once R3 and R4 were tested.
template <int K>
void ViolationIndex<K>::NoteJudged(std::uint32_t star, std::optional<Rule> rule) {
  is_entered_[star] = 0;
  if (!rule) return;
  violating_.push_back(star);
  ++(*rule == Rule::kShape ? slivers_ : inconsistent_);
}

template <int K>
void ViolationIndex<K>::NoteFailedAttempt(std::uint32_t star) {
  if (!is_given_up(star)) ++failed_attempts_[star];
}

STELLATE_INSTANTIATE_CLASS(ViolationIndex)

}  // namespace stellate::core
