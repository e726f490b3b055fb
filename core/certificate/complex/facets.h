#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/certificate/complex/topology.h"

namespace stellate::core {

// One side of a facet, sorted by the facet, then by the simplex.
template <int K>
class SimplexFacet {
 public:
  SimplexFacet() = default;
  // The facet of the simplex with these vertices without the omitted one; v is the facet's lowest
  // vertex.
  SimplexFacet(std::uint32_t simplex, const std::uint32_t* ids, std::uint32_t v, int omitted)
      : omitted_(static_cast<std::uint32_t>(omitted)) {
    for (int i = 1; i <= K; ++i)
      if (i != omitted && ids[i] != v) Append(ids[i]);
    Append(simplex);
  }

  std::uint32_t simplex() const { return static_cast<std::uint32_t>(digits_[kWords - 1]); }
  std::uint32_t omitted() const { return omitted_; }  // number of the opposite vertex

  bool SameFacet(const SimplexFacet& other) const {
    bool same = digits_[kWords - 1] >> 32 == other.digits_[kWords - 1] >> 32;
    for (int w = 0; w + 1 < kWords; ++w) same = same && digits_[w] == other.digits_[w];
    return same;
  }
  bool operator<(const SimplexFacet& other) const {
    for (int w = 0; w + 1 < kWords; ++w)
      if (digits_[w] != other.digits_[w]) return digits_[w] < other.digits_[w];
    return digits_[kWords - 1] < other.digits_[kWords - 1];
  }

 private:
  // The facet's vertices without v, ascending, then the simplex: K ids, as digits of one large
  // number.
  static constexpr int kWords = (K + 1) / 2;

  void Append(std::uint32_t id) {
    for (int w = 0; w + 1 < kWords; ++w) digits_[w] = digits_[w] << 32 | digits_[w + 1] >> 32;
    digits_[kWords - 1] = digits_[kWords - 1] << 32 | id;
  }

  std::array<std::uint64_t, kWords> digits_{};
  std::uint32_t omitted_ = 0;
};

// Calls visit(std::span<const SimplexFacet<K>>) for each facet whose lowest vertex is in [begin,
// end), with its sides in the order of their simplices, at least one. For K = 1 leaves out the
// facet that is the vertex `apex`.
template <int K, typename Visit>
void ForEachFacet(const VertexStars& stars, std::uint32_t begin, std::uint32_t end,
                  std::uint32_t apex, const Visit& visit) {
  const SimplexList& list = stars.list();
  std::vector<SimplexFacet<K>> sides;
  for (std::uint32_t v = begin; v < end; ++v) {
    if (K == 1 && v == apex) continue;
    sides.clear();
    for (const std::uint32_t s : stars.Star(v)) {
      const std::uint32_t* ids = list[s];
      // v is the lowest vertex of the simplex, or becomes it if the lowest is omitted.
      if (ids[0] != v && ids[1] != v) continue;
      const int first = ids[0] == v ? 1 : 0;
      const int last = ids[0] == v ? K : 0;
      for (int omit = first; omit <= last; ++omit) sides.emplace_back(s, ids, v, omit);
    }
    std::sort(sides.begin(), sides.end());
    for (std::size_t i = 0; i < sides.size();) {
      std::size_t next = i + 1;
      while (next < sides.size() && sides[next].SameFacet(sides[i])) ++next;
      visit(std::span<const SimplexFacet<K>>(sides.data() + i, next - i));
      i = next;
    }
  }
}

}  // namespace stellate::core
