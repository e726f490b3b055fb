#include "pipe/numbers.h"

#include <charconv>
#include <cstdio>
#include <cstdlib>

namespace stellate::pipe {

void AppendNumber(double number, std::string* to) {
  char digits[512];  // the longest has a sign, "0.", 323 zeros and 17 digits
  const auto end = std::to_chars(digits, digits + sizeof digits, number, std::chars_format::fixed);
  to->append(digits, end.ptr);
}

bool ParseNumber(std::string_view text, double* number) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  const char* const end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, *number);
  if (parsed.ptr != end || parsed.ec == std::errc::invalid_argument) return false;
  // Zero or infinite, and from_chars does not say which.
  if (parsed.ec != std::errc()) *number = std::strtod(std::string(text).c_str(), nullptr);
  return true;
}

std::vector<std::string_view> Split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  while (true) {
    const size_t at = text.find(separator);
    parts.push_back(text.substr(0, at));
    if (at == std::string_view::npos) return parts;
    text.remove_prefix(at + 1);
  }
}

std::vector<std::string_view> Words(std::string_view text) {
  constexpr const char* kBlanks = " \t\r";
  std::vector<std::string_view> words;
  while (true) {
    const size_t begin = text.find_first_not_of(kBlanks);
    if (begin == std::string_view::npos) return words;
    text.remove_prefix(begin);
    const size_t length = std::min(text.find_first_of(kBlanks), text.size());
    words.push_back(text.substr(0, length));
    text.remove_prefix(length);
  }
}

std::string Quoted(std::string_view bytes) {
  constexpr size_t kShown = 80;
  std::string shown = "'";
  for (const char c : bytes.substr(0, kShown)) {
    if (c >= ' ' && c <= '~') {
      shown += c;
    } else {
      char escaped[8];
      std::snprintf(escaped, sizeof escaped, "\\x%02x", static_cast<unsigned char>(c));
      shown += escaped;
    }
  }
  return shown + (bytes.size() > kShown ? "...'" : "'");
}

}  // namespace stellate::pipe
