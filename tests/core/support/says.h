#pragma once

#include <string>

namespace stellate::core::testing {

// Whether the words are in the text.
inline bool Says(const std::string& text, const std::string& words) {
  return text.find(words) != std::string::npos;
}

}  // namespace stellate::core::testing
