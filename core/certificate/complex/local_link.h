#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stellate::core {

// Decides from the star of one vertex alone whether its link is a sphere, K = 1 to 3. Keep one for
// many stars: it reuses its memory.
template <int K>
class LocalLink {
  static_assert(K >= 1 && K <= 3);

 public:
  // Whether the link is a sphere and two simplices that share a facet always lie on different sides
  // of it, by the `signs` of their determinants. False also if the star is too large to be decided
  // here. `columns`: by simplex of the star, the numbers of its other K vertices in the order of
  // their ids; numbers are below `vertices`, and each occurs.
  bool IsSphereUnfolded(std::span<const std::uint32_t> columns, std::uint32_t vertices,
                        const std::vector<int>& signs) {
    const std::size_t simplices = columns.size() / K;
    if (vertices > kMostVertices || simplices > kMostSimplices) return false;
    if (!Match(columns, vertices, signs.data()) || !IsConnected(simplices)) return false;
    // V - E + F with E = 3 F / 2. A closed connected surface pinched somewhere has less than its
    // normalisation, so 2 means a sphere; a closed connected curve is a circle.
    return K < 3 || 2 * std::size_t{vertices} == simplices + 4;
  }

 private:
  static constexpr std::uint32_t kMostVertices = 128, kMostSimplices = 1 << 13;
  // The state of a facet: open, closed, or 4 * simplex + opposite column + 1 of the only simplex
  // seen with it.
  static constexpr std::uint16_t kOpen = 0, kClosed = 0xffff;

  // The facet opposite column c, as a place in the table.
  static std::uint32_t FacetOf(const std::uint32_t* columns, int c, std::uint32_t vertices) {
    if constexpr (K == 1) return 0;
    if constexpr (K == 2) return columns[1 - c];
    return c == 0   ? columns[1] * vertices + columns[2]
           : c == 1 ? columns[0] * vertices + columns[2]
                    : columns[0] * vertices + columns[1];
  }

  // Whether each facet through the vertex is in exactly two simplices, which differ and lie on
  // different sides of it.
  bool Match(std::span<const std::uint32_t> columns, std::uint32_t vertices, const int* signs) {
    const std::size_t facets = K == 1 ? 1 : K == 2 ? vertices : std::size_t{vertices} * vertices;
    seen_.assign(facets, kOpen);
    if (across_.size() < columns.size()) across_.resize(columns.size());
    const auto simplices = static_cast<std::uint32_t>(columns.size() / K);
    std::uint16_t* const seen = seen_.data();
    std::uint32_t* const across = across_.data();
    std::size_t matched = 0;
    const std::uint32_t* column = columns.data();
    for (std::uint32_t s = 0; s < simplices; ++s, column += K) {
      for (std::uint32_t c = 0; c < K; ++c) {
        std::uint16_t& known = seen[FacetOf(column, static_cast<int>(c), vertices)];
        if (known == kOpen) {
          known = static_cast<std::uint16_t>(4 * s + c + 1);
          continue;
        }
        if (known == kClosed) return false;
        const std::uint32_t t = (known - 1u) / 4, b = (known - 1u) % 4;
        if (columns[t * K + b] == column[c]) return false;
        // With the apex moved behind the facet the two determinants must differ in sign.
        if ((signs[s] == signs[t]) == ((b + c) % 2 == 0)) return false;
        across[s * K + c] = t;
        across[t * K + b] = s;
        known = kClosed;
        matched += 2;
      }
    }
    return matched == columns.size();
  }

  // Whether all simplices are reached from the first across facets.
  bool IsConnected(std::size_t simplices) {
    reached_.assign(simplices, 0);
    if (stack_.size() < simplices) stack_.resize(simplices);
    std::uint8_t* const reached = reached_.data();
    std::uint32_t* top = stack_.data();
    std::size_t count = 1;
    reached[0] = 1;
    *top++ = 0;
    while (top != stack_.data()) {
      const std::uint32_t* const across = across_.data() + std::size_t{*--top} * K;
      for (int c = 0; c < K; ++c) {
        const std::uint32_t t = across[c];
        if (reached[t]) continue;
        reached[t] = 1;
        *top++ = t;
        ++count;
      }
    }
    return count == simplices;
  }

  std::vector<std::uint16_t> seen_;    // by facet
  std::vector<std::uint32_t> across_;  // by simplex and column: the simplex across that facet
  std::vector<std::uint8_t> reached_;  // by simplex
  std::vector<std::uint32_t> stack_;
};

}  // namespace stellate::core
