#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

// What every target of this folder has: an entry that must survive any bytes, and inputs to start
// from. Under clang libFuzzer drives the entry; everywhere else replay.cc does.

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace stellate::fuzz {

// Inputs that reach deep; made by the program, so that they follow the format as it changes.
std::vector<std::string> Seeds();

// Ends the process in a way that every fuzzer takes for a finding.
inline void Require(bool condition, const char* what) {
  if (condition) return;
  std::fprintf(stderr, "REQUIRED: %s\n", what);
  std::abort();
}

// Takes an input apart. Past its end everything is zero.
class Script {
 public:
  Script(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  bool empty() const { return at_ >= size_; }
  std::uint8_t Byte() { return empty() ? 0 : data_[at_++]; }
  std::uint32_t Number(int bytes) {
    std::uint32_t number = 0;
    for (int i = 0; i < bytes; ++i) number = number << 8 | Byte();
    return number;
  }
  std::string Bytes(std::size_t count) {
    std::string bytes;
    while (bytes.size() < count && !empty()) bytes.push_back(static_cast<char>(Byte()));
    return bytes;
  }
  std::string Rest() { return Bytes(size_); }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
  std::size_t at_ = 0;
};

}  // namespace stellate::fuzz
