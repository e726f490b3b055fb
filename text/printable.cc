#include "text/printable.h"

#include <utf8.h>

#include <iterator>

namespace stellate::text {
namespace {

bool CommandsReaders(char32_t c) {
  return c < 0x20 || (c >= 0x7f && c < 0xa0) || c == 0x061c || c == 0x200e || c == 0x200f ||
         (c >= 0x2028 && c <= 0x202e) || (c >= 0x2066 && c <= 0x2069);
}

}  // namespace

std::string Printable(std::string_view text, char stand_in) {
  std::string valid;
  valid.reserve(text.size());
  utf8::replace_invalid(text.begin(), text.end(), std::back_inserter(valid),
                        static_cast<utf8::uint32_t>(stand_in));
  std::string printable;
  printable.reserve(valid.size());
  for (auto at = valid.begin(); at != valid.end();) {
    const auto begin = at;
    const char32_t c = utf8::next(at, valid.end());
    if (CommandsReaders(c)) {
      printable += stand_in;
    } else {
      printable.append(begin, at);
    }
  }
  return printable;
}

std::string PrintableLines(std::string_view text, char stand_in) {
  std::string lines;
  for (std::size_t end = 0;; text.remove_prefix(end + 1)) {
    end = text.find('\n');
    lines += Printable(text.substr(0, end), stand_in);
    if (end == std::string_view::npos) return lines;
    lines += "\n  ";
  }
}

}  // namespace stellate::text
