#include "core/certificate/complex/fundamental_group.h"

#include <algorithm>

namespace stellate::core {
namespace {

// Lists of incident items in one array.
struct Incidence {
  std::vector<std::uint32_t> begin, items;
};

template <typename Items>
Incidence Invert(const Items& items, std::uint32_t targets) {
  Incidence result;
  result.begin.assign(targets + 1, 0);
  for (const auto& item : items) {
    for (const std::uint32_t t : item) ++result.begin[t + 1];
  }
  for (std::uint32_t t = 0; t < targets; ++t) result.begin[t + 1] += result.begin[t];
  std::vector<std::uint32_t> next(result.begin.begin(), result.begin.end() - 1);
  result.items.resize(result.begin[targets]);
  for (std::uint32_t i = 0; i < items.size(); ++i) {
    for (const std::uint32_t t : items[i]) result.items[next[t]++] = i;
  }
  return result;
}

// Marks the edges of a breadth-first tree from `root` and all that follow from it as trivial.
class Contraction {
 public:
  explicit Contraction(const TwoSkeleton& skeleton)
      : skeleton_(skeleton),
        edges_of_vertex_(Invert(skeleton.edges, skeleton.vertices)),
        triangles_of_edge_(
            Invert(skeleton.triangles, static_cast<std::uint32_t>(skeleton.edges.size()))) {}

  bool TrivialFrom(std::uint32_t root) {
    trivial_.assign(skeleton_.edges.size(), 0);
    open_edges_.assign(skeleton_.triangles.size(), 3);
    std::vector<std::uint8_t> reached(skeleton_.vertices, 0);
    std::vector<std::uint32_t> queue{root};
    reached[root] = 1;
    for (std::size_t head = 0; head < queue.size(); ++head) {
      const std::uint32_t v = queue[head];
      for (std::uint32_t i = edges_of_vertex_.begin[v]; i < edges_of_vertex_.begin[v + 1]; ++i) {
        const std::uint32_t e = edges_of_vertex_.items[i];
        const auto [a, b] = skeleton_.edges[e];
        const std::uint32_t w = a == v ? b : a;
        if (reached[w]) continue;
        reached[w] = 1;
        queue.push_back(w);
        MakeTrivial(e);
      }
    }
    return std::all_of(trivial_.begin(), trivial_.end(), [](auto t) { return t != 0; });
  }

  // Rank over Z/2 of the relations on the edges left, against their number.
  bool HomologyVanishes() const {
    std::vector<std::uint32_t> column(trivial_.size(), 0);
    std::uint32_t open = 0;
    for (std::size_t e = 0; e < trivial_.size(); ++e) {
      if (!trivial_[e]) column[e] = open++;
    }
    const std::size_t words = (open + 63) / 64;
    std::vector<std::vector<std::uint64_t>> pivots(open);
    std::uint32_t rank = 0;
    for (const auto& triangle : skeleton_.triangles) {
      std::vector<std::uint64_t> row(words, 0);
      for (const std::uint32_t e : triangle) {
        if (!trivial_[e]) row[column[e] / 64] ^= std::uint64_t{1} << (column[e] % 64);
      }
      for (std::uint32_t c = 0; c < open; ++c) {
        if (!(row[c / 64] >> (c % 64) & 1)) continue;
        if (pivots[c].empty()) {
          pivots[c] = std::move(row);
          ++rank;
          break;
        }
        for (std::size_t w = 0; w < words; ++w) row[w] ^= pivots[c][w];
      }
      if (rank == open) break;
    }
    return rank == open;
  }

 private:
  void MakeTrivial(std::uint32_t edge) {
    pending_.push_back(edge);
    while (!pending_.empty()) {
      const std::uint32_t e = pending_.back();
      pending_.pop_back();
      if (trivial_[e]) continue;
      trivial_[e] = 1;
      for (std::uint32_t i = triangles_of_edge_.begin[e]; i < triangles_of_edge_.begin[e + 1];
           ++i) {
        const std::uint32_t t = triangles_of_edge_.items[i];
        if (--open_edges_[t] != 1) continue;
        for (const std::uint32_t last : skeleton_.triangles[t]) {
          if (!trivial_[last]) pending_.push_back(last);
        }
      }
    }
  }

  const TwoSkeleton& skeleton_;
  const Incidence edges_of_vertex_, triangles_of_edge_;
  std::vector<std::uint8_t> trivial_;
  std::vector<std::uint8_t> open_edges_;  // of each triangle, not yet known to be trivial
  std::vector<std::uint32_t> pending_;
};

}  // namespace

LoopVerdict ClassifyLoops(const TwoSkeleton& skeleton) {
  Contraction contraction(skeleton);
  for (std::uint32_t root = 0; root < skeleton.vertices; ++root) {
    if (contraction.TrivialFrom(root)) return LoopVerdict::kSimplyConnected;
  }
  return contraction.HomologyVanishes() ? LoopVerdict::kNoHomology : LoopVerdict::kHasHomology;
}

}  // namespace stellate::core
