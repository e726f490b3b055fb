#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace stellate::client {

// A .zip archive in memory, whose files are deflated by zlib. The same files, the same bytes: all
// are of January 1, 1980.
//
//   Zip zip;
//   zip.Add("a.txt", text);
//   return WriteFile(path, zip.Finish());
class Zip {
 public:
  // Numbers above `largest` are written in ZIP64's fields of 64 bits, which not every reader knows;
  // the plain ones have 32, and all of them set say that it is elsewhere.
  explicit Zip(std::uint64_t largest = 0xFFFFFFFE) : largest_(largest) {}

  // `name`: of ASCII. Throws std::bad_alloc.
  void Add(std::string_view name, std::string_view bytes);
  std::string Finish();

 private:
  std::uint64_t largest_;
  std::string bytes_, directory_;
  std::uint64_t files_ = 0;
};

}  // namespace stellate::client
