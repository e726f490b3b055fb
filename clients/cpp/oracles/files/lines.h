#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace stellate::oracles::files {

// Refuses what follows `place`, "line 7" or "byte 120", unless `left` bytes can hold `count` things
// of at least `least` bytes each.
void CheckAgainstSize(std::uint64_t count, const std::string& what, size_t least, size_t left,
                      const std::string& place);

// A text, line by line. Everything refused is refused with the line's number.
class Lines {
 public:
  // What follows `comment` on a line is skipped; '\0' where a format has no comments.
  // The text before `at`, of `lines` lines, was read by others.
  Lines(std::string_view text, char comment, size_t at = 0, size_t lines = 0)
      : text_(text), comment_(comment), at_(at), number_(lines) {}

  // On to the next line that has words; false where there is none.
  bool Next();
  // The same, where `what` has to follow.
  void Need(const std::string& what);

  // Of this line, blanks between them.
  const std::vector<std::string_view>& words() const { return words_; }
  // Refused unless the line has that many at least.
  void NeedWords(size_t count, const std::string& what) const;
  double Number(size_t word) const;       // finite
  std::int64_t Whole(size_t word) const;  // of either sign
  std::uint64_t Count(std::string_view text, const std::string& what) const;
  // Compares a count from this line with the bytes that follow; the last line may have no end.
  void Expect(std::uint64_t count, const std::string& what, size_t least) const {
    if (count > (left() + 1) / least) CheckAgainstSize(count, what, least, left(), place());
  }

  size_t number() const { return number_; }  // of this line, from 1
  std::string place() const { return "line " + std::to_string(number_); }
  size_t offset() const { return at_; }  // where the next line begins
  size_t left() const { return text_.size() - at_; }
  [[noreturn]] void Refuse(const std::string& why) const;

 private:
  std::string_view text_;
  char comment_;
  size_t at_, number_;
  std::vector<std::string_view> words_;
};

}  // namespace stellate::oracles::files
