#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/instantiate.h"
#include "core/rules/rules.h"

namespace stellate::core {

// The violations that are known between rounds, by star: which rule each star breaks, which stars
// are dirty (to be tested again), and how often attempts to fix a star have failed. Stars are
// numbered as in the complex, and violations refer to its cells.
//
//   violations.Update(count, judged, entries);        // R1 and R2, after an insertion
//   for (star : violations.TakeDirty({}))             // R3 and R4, once those hold
//     violations.NoteJudged(star, rule);
template <int K>
class ViolationIndex {
 public:
  struct Entry {
    std::uint32_t star;
    Violation<K> violation;
  };

  std::uint32_t star_count() const { return static_cast<std::uint32_t>(is_entered_.size()); }

  // Updates R1 and R2 after an insertion: there are `count` stars now. Those in `judged` are new or
  // changed, and `entries` has their violations, which replace the earlier ones.
  void Update(std::uint32_t count, const std::vector<std::uint32_t>& judged,
              std::vector<Entry> entries);
  // Replaces the violations of all stars, after their bounds changed.
  void Replace(std::vector<Entry> entries);
  // Returns the violations of R1 and R2, one for each star.
  const std::vector<Entry>& size_and_shape() const { return size_and_shape_; }

  // R3 and R4 are tested once R1 and R2 hold. Until then, and after MarkAllDirty, all stars are
  // dirty.
  bool are_all_dirty() const { return all_dirty_; }
  void MarkAllDirty();
  void MarkDirty(const std::vector<std::uint32_t>& stars);
  // Returns the stars to test now, ascending: the dirty ones, those with a violation, and `others`.
  // Afterwards none is dirty or has a violation.
  std::vector<std::uint32_t> TakeDirty(const std::vector<std::uint32_t>& others);
  // Records the test of a star: the rule that it breaks, or nothing.
  void NoteJudged(std::uint32_t star, std::optional<Rule> rule);
  std::uint64_t violating() const { return violating_.size(); }
  const std::vector<std::uint32_t>& violating_stars() const { return violating_; }
  std::uint64_t slivers() const { return slivers_; }  // among the violating stars
  std::uint64_t inconsistent() const { return inconsistent_; }

  // Failed attempts to fix a star since it last changed. A star with too many is given up.
  int failed_attempts(std::uint32_t star) const { return failed_attempts_[star]; }
  bool is_given_up(std::uint32_t star) const { return failed_attempts_[star] > kMostAttempts; }
  void NoteFailedAttempt(std::uint32_t star);
  // Call it when other rules apply: attempts may succeed then.
  void ForgetAttempts() { failed_attempts_.assign(failed_attempts_.size(), 0); }
  void GiveUp(std::uint32_t star) { failed_attempts_[star] = kMostAttempts + 1; }

  // Whether an intersection with a flat was not found for a star: query closest points instead.
  bool has_no_flat(std::uint32_t star) const { return no_flat_[star]; }
  void NoteNoFlat(std::uint32_t star) { no_flat_[star] = 1; }
  void ForgetFlats() { no_flat_.assign(no_flat_.size(), 0); }

 private:
  static constexpr int kMostAttempts = 8;

  std::vector<Entry> size_and_shape_;
  std::vector<std::uint8_t> is_entered_;  // by star: in size_and_shape_, and not tested since
  std::vector<std::uint8_t> failed_attempts_;
  std::vector<std::uint8_t> no_flat_;
  bool all_dirty_ = true;
  std::vector<std::uint32_t> dirty_;      // unless all are; with repetitions
  std::vector<std::uint32_t> violating_;  // those that break R3 or R4
  std::uint64_t slivers_ = 0, inconsistent_ = 0;
};

STELLATE_DECLARE_CLASS(ViolationIndex)

}  // namespace stellate::core
