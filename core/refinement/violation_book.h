#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/instantiate.h"
#include "core/refinement/rules.h"

namespace stellate::core {

// What is known of the stars between rounds: which break which rule, which are to be judged again,
// and how often it was tried in vain to mend them. Stars are numbered as in the complex, whose
// cells the violations refer to.
template <int K>
class ViolationBook {
 public:
  struct Entry {
    std::uint32_t star;
    Violation<K> violation;
  };

  std::uint32_t star_count() const { return static_cast<std::uint32_t>(is_entered_.size()); }

  // Rules R1 and R2. After an insertion: there are `count` stars now, of which `judged` are new or
  // changed, and these break a rule; what was known of them before is forgotten.
  void Update(std::uint32_t count, const std::vector<std::uint32_t>& judged,
              std::vector<Entry> entries);
  // All stars were judged again, by other bounds.
  void Replace(std::vector<Entry> entries);
  // One violation a star.
  const std::vector<Entry>& size_and_shape() const { return size_and_shape_; }

  // Rules R3 and R4, which are judged once R1 and R2 hold. Until then, and after JudgeAllAnew, all
  // stars are suspects.
  bool are_all_suspect() const { return all_suspect_; }
  void JudgeAllAnew();
  void Suspect(const std::vector<std::uint32_t>& stars);
  // The stars to judge now, ascending: the suspects, those with a blemish, and `besides`. There are
  // no suspects and no blemishes afterwards.
  std::vector<std::uint32_t> TakeSuspects(const std::vector<std::uint32_t>& besides);
  // A star that was judged: with which rule it breaks, or without a blemish.
  void NoteJudged(std::uint32_t star, std::optional<Rule> blemish);
  std::uint64_t blemished() const { return blemished_.size(); }
  const std::vector<std::uint32_t>& blemished_stars() const { return blemished_; }
  std::uint64_t slivers() const { return slivers_; }  // of the blemished
  std::uint64_t inconsistent() const { return inconsistent_; }

  // Attempts to mend a star that failed since it last changed. One that failed too often is left
  // alone.
  int failed_attempts(std::uint32_t star) const { return failed_attempts_[star]; }
  bool is_given_up(std::uint32_t star) const { return failed_attempts_[star] > kMostAttempts; }
  void NoteFailedAttempt(std::uint32_t star);
  // What failed may succeed by other rules.
  void ForgetAttempts() { failed_attempts_.assign(failed_attempts_.size(), 0); }
  void GiveUp(std::uint32_t star) { failed_attempts_[star] = kMostAttempts + 1; }

  // Stars for which an intersection with a flat was not found: closest points are asked for
  // instead.
  bool has_no_flat(std::uint32_t star) const { return no_flat_[star]; }
  void NoteNoFlat(std::uint32_t star) { no_flat_[star] = 1; }
  void ForgetFlats() { no_flat_.assign(no_flat_.size(), 0); }

 private:
  static constexpr int kMostAttempts = 8;

  std::vector<Entry> size_and_shape_;
  std::vector<std::uint8_t> is_entered_;  // by star: in size_and_shape_, and not judged since
  std::vector<std::uint8_t> failed_attempts_;
  std::vector<std::uint8_t> no_flat_;
  bool all_suspect_ = true;
  std::vector<std::uint32_t> suspects_;   // unless all are; with repetitions
  std::vector<std::uint32_t> blemished_;  // those that break R3 or R4
  std::uint64_t slivers_ = 0, inconsistent_ = 0;
};

STELLATE_DECLARE_CLASS(ViolationBook)

}  // namespace stellate::core
