#pragma once

#include <charconv>
#include <cmath>
#include <string>
#include <string_view>
#include <type_traits>

namespace stellate::core {

// Joins text and numbers to one message. Doubles are written with the fewest digits that read back
// as the same value, so that a refused value can be found in the caller's data.
//
//   Message("epsilon is ", 0.1, ", not > ", 1);  // "epsilon is 0.1, not > 1"
//
// A part is anything that std::string_view takes, an integer or a floating point number; no bool.
template <typename... Parts>
std::string Message(const Parts&... parts) {
  std::string text;
  const auto append = [&text](const auto& part) {
    using T = std::decay_t<decltype(part)>;
    if constexpr (std::is_floating_point_v<T>) {
      if (std::isnan(part)) {
        text += "NaN";
        return;
      }
    }
    if constexpr (std::is_arithmetic_v<T>) {
      char digits[40];
      const auto end = std::to_chars(digits, digits + sizeof(digits), part).ptr;
      text.append(digits, end);
    } else {
      text += std::string_view(part);
    }
  };
  (append(parts), ...);
  return text;
}

// Writes a measured value for people: four digits, no more than its error allows. Use it for what
// was computed; a value that the caller gave is written whole, by Message.
//
//   Brief(2.0 / 3);  // "0.6667"
inline std::string Brief(double value) {
  char digits[40];
  const auto end =
      std::to_chars(digits, digits + sizeof(digits), value, std::chars_format::general, 4).ptr;
  return std::string(digits, end);
}

}  // namespace stellate::core
