#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stellate::core {

// Remembers the common centres that were computed last. A simplex is judged in the stars of all its
// vertices, and consecutive stars are mostly near each other, so that its centre is needed again
// soon. One for each thread; its contents change no result.
//
//   thread_local CentreCache<K> cache;
//   cache.Centre(owner.id(), simplex, key, d, centre, [&](double* c) { return Compute(c); });
template <int K>
class CentreCache {
 public:
  using Simplex = std::array<std::uint32_t, K + 1>;  // ascending ids

  // Identifies the points and weights to which centres belong: give the class that holds these an
  // Owner, and assign a new one whenever they change. A copy is another owner, as the copied class
  // may then change by itself.
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

  // Writes the centre of a simplex (d numbers), or returns false if it has none. A centre that is
  // not remembered is computed by `find(centre)`. `key`: a hash of the simplex.
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
  // The centres of some thousand stars for K = 3: they fit in the processor's cache.
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
