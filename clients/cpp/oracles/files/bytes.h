#pragma once

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>
#include <string_view>

#include "oracles/combined/common.h"

namespace stellate::oracles::files {

// Numbers one after the other, as they lie in a binary file.
class Bytes {
 public:
  Bytes(std::string_view bytes, size_t at, std::endian order)
      : bytes_(bytes), at_(at), order_(order) {}

  template <typename Number>
  Number Take() {
    Need(sizeof(Number));
    char raw[sizeof(Number)];
    std::memcpy(raw, bytes_.data() + at_, sizeof raw);
    if (order_ != std::endian::native) std::reverse(raw, raw + sizeof raw);
    at_ += sizeof raw;
    Number number;
    std::memcpy(&number, raw, sizeof number);
    return number;
  }
  void Skip(size_t count) {
    Need(count);
    at_ += count;
  }
  size_t left() const { return bytes_.size() - at_; }
  size_t at() const { return at_; }
  std::string place() const { return "byte " + std::to_string(at_); }

 private:
  void Need(size_t count) const {
    if (count > left()) Refuse(place() + ": the file ends within a number: is it cut short?");
  }

  std::string_view bytes_;
  size_t at_;
  std::endian order_;
};

}  // namespace stellate::oracles::files
