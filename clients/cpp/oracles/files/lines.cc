#include "oracles/files/lines.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "oracles/combined/common.h"
#include "pipe/numbers.h"

namespace stellate::oracles::files {

void CheckAgainstSize(std::uint64_t count, const std::string& what, size_t least, size_t left,
                      const std::string& place) {
  if (count <= left / least) return;
  oracles::Refuse(place + ": says that " + std::to_string(count) + " " + what + " follow, and " +
                  std::to_string(left) + " bytes cannot hold them: is the file cut short?");
}

bool Lines::Next() {
  while (at_ < text_.size()) {
    const size_t end = std::min(text_.find('\n', at_), text_.size());
    std::string_view line = text_.substr(at_, end - at_);
    at_ = std::min(end + 1, text_.size());
    ++number_;
    if (comment_ != '\0') line = line.substr(0, line.find(comment_));
    words_ = pipe::Words(line);
    if (!words_.empty()) return true;
  }
  return false;
}

void Lines::Need(const std::string& what) {
  if (!Next()) Refuse("the file ends where " + what + " should follow: is it cut short?");
}

void Lines::NeedWords(size_t count, const std::string& what) const {
  if (words_.size() >= count) return;
  Refuse(what + " needs " + std::to_string(count) + " words on its line, and has " +
         std::to_string(words_.size()));
}

double Lines::Number(size_t word) const {
  double number = 0;
  if (!pipe::ParseNumber(words_[word], &number) || !std::isfinite(number)) {
    Refuse(pipe::Quoted(words_[word]) + " is no finite number, written like -1.5e3");
  }
  return number;
}

std::int64_t Lines::Whole(size_t word) const {
  const std::string_view text = words_[word];
  std::int64_t number = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (end != text.data() + text.size() || status != std::errc()) {
    Refuse(pipe::Quoted(text) + " is no whole number");
  }
  return number;
}

std::uint64_t Lines::Count(std::string_view text, const std::string& what) const {
  std::uint64_t number = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (end != text.data() + text.size() || status != std::errc()) {
    Refuse("says how many " + what + " there are, and " + pipe::Quoted(text) +
           " is no such number");
  }
  return number;
}

void Lines::Refuse(const std::string& why) const { oracles::Refuse(place() + ": " + why); }

}  // namespace stellate::oracles::files
