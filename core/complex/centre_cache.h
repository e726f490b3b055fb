#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stellate::core {

// The common centres that were asked for last. A simplex is judged in the stars of all its
// vertices, and stars that follow each other are mostly near each other: it is remembered from one
// to the next. One a thread; what it holds changes no result.
template <int K>
class CentreCache {
 public:
  using Simplex = std::array<std::uint32_t, K + 1>;  // ascending ids

  // Stands for the points and weights that centres are of: give whatever holds these an Owner, and
  // assign a new one whenever they change. A copy is another owner, as what it belongs to goes on
  // apart from the original.
  class Owner {
   public:
    Owner() : id_(NewId()) {}
    Owner(const Owner&) : Owner() {}
    Owner& operator=(const Owner&) {
      id_ = NewId();
      return *this;
    }
    ~Owner() = default;
    std::uint64_t id() const { return id_; }

   private:
    static std::uint64_t NewId() {
      static std::atomic<std::uint64_t> last{0};
      return ++last;
    }

    std::uint64_t id_;
  };

  // Writes the centre of a simplex (d numbers), or returns false if it has none. What is not
  // remembered `find(centre)` tells. `key` scatters simplices.
  template <typename Find>
  bool Centre(std::uint64_t owner, const Simplex& simplex, std::uint64_t key, int d, double* centre,
              const Find& find) {
    const auto width = static_cast<std::size_t>(d);
    if (width != width_) {
      width_ = width;
      entries_.assign(kEntries, {});
      centres_.resize(kEntries * width);
    }
    const std::size_t at = key % kEntries;
    Entry& entry = entries_[at];
    double* const known = centres_.data() + at * width;
    if (entry.owner != owner || entry.simplex != simplex) entry = {owner, simplex, find(known)};
    if (entry.found) std::copy_n(known, d, centre);
    return entry.found;
  }

 private:
  // Those of some thousand stars for K = 3: they fit in the processor's own memory.
  static constexpr std::size_t kEntries = 8192;

  struct Entry {
    std::uint64_t owner = 0;  // none
    Simplex simplex{};
    bool found = false;
  };

  std::size_t width_ = 0;
  std::vector<Entry> entries_;
  std::vector<double> centres_;  // by entry, d each, relative to the simplex' first point
};

}  // namespace stellate::core
