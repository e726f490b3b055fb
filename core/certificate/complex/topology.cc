#include "core/certificate/complex/topology.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <numeric>
#include <utility>

#include "core/base/first_ids.h"
#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {
namespace {

// One side of a facet, sorted by the facet, then by the simplex.
template <int K>
class FacetSide {
 public:
  FacetSide() = default;
  // The facet of the simplex with these vertices without the omitted one; v is the facet's lowest
  // vertex.
  FacetSide(std::uint32_t simplex, const std::uint32_t* ids, std::uint32_t v, int omitted)
      : omitted_(static_cast<std::uint32_t>(omitted)) {
    for (int i = 1; i <= K; ++i)
      if (i != omitted && ids[i] != v) Append(ids[i]);
    Append(simplex);
  }

  std::uint32_t simplex() const { return static_cast<std::uint32_t>(digits_[kWords - 1]); }
  std::uint32_t omitted() const { return omitted_; }  // number of the opposite vertex

  bool SameFacet(const FacetSide& other) const {
    bool same = digits_[kWords - 1] >> 32 == other.digits_[kWords - 1] >> 32;
    for (int w = 0; w + 1 < kWords; ++w) same = same && digits_[w] == other.digits_[w];
    return same;
  }
  bool operator<(const FacetSide& other) const {
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

std::uint32_t Root(std::vector<std::uint32_t>& parent, std::uint32_t v) {
  while (parent[v] != v) {
    parent[v] = parent[parent[v]];
    v = parent[v];
  }
  return v;
}

std::uint64_t CountComponents(const Adjacency& adjacency) {
  const SimplexList& list = adjacency.list();
  std::vector<std::uint32_t> parent(list.vertices);
  std::iota(parent.begin(), parent.end(), 0u);
  for (std::uint32_t s = 0; s < list.size(); ++s) {
    CheckInterruption(s);
    for (int i = 1; i <= list.k; ++i) {
      const std::uint32_t a = Root(parent, list[s][0]);
      const std::uint32_t b = Root(parent, list[s][i]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  std::uint64_t components = 0;
  for (std::uint32_t v = 0; v < list.vertices; ++v) {
    CheckInterruption(v);
    if (!adjacency.Star(v).empty() && Root(parent, v) == v) ++components;
  }
  return components;
}

// Facets inherit opposite orientations from their two sides: sign_s (-1)^i = -sign_t (-1)^j.
// Returns the number of parts that facets join.
std::size_t Orient(const Adjacency& adjacency, Connectivity& result) {
  const SimplexList& list = adjacency.list();
  const int k = list.k;
  result.orientable = true;
  result.orientation.assign(list.size(), 0);
  std::int8_t* const sign = result.orientation.data();
  std::vector<std::uint32_t> stack;
  std::size_t steps = 0;
  std::size_t parts = 0;
  for (std::uint32_t start = 0; start < list.size(); ++start) {
    if (sign[start] != 0) continue;
    ++parts;
    sign[start] = 1;
    stack.push_back(start);
    while (!stack.empty()) {
      CheckInterruption(steps++);
      const std::uint32_t s = stack.back();
      stack.pop_back();
      for (int i = 0; i <= k; ++i) {
        const std::uint32_t t = adjacency.Across(s, i);
        if (t == Adjacency::kNone) continue;
        const int j = adjacency.Apex(s, t);
        const auto wanted = static_cast<std::int8_t>((i + j) % 2 == 0 ? -sign[s] : sign[s]);
        if (sign[t] == 0) {
          sign[t] = wanted;
          stack.push_back(t);
        } else if (sign[t] != wanted) {
          result.orientable = false;
        }
      }
    }
  }
  if (!result.orientable) result.orientation.clear();
  return parts;
}

// A union-find forest of vertices, joined by ties that say whether the stars of two vertices are
// oriented oppositely. Any number of threads may tie concurrently: the trees in the end, and
// whether some tie contradicts others, do not depend on the order.
class VertexForest {
 public:
  explicit VertexForest(std::uint32_t vertices)
      : vertices_(vertices), up_(std::make_unique<std::atomic<Up>[]>(vertices)) {
    ParallelFor(vertices, [&](std::uint32_t v) { up_[v].store(Pack(v, 0), kRelaxed); });
  }

  // Returns false if this tie contradicts others.
  bool Join(std::uint32_t a, std::uint32_t b, bool flips) {
    const Up differ = flips ? 1 : 0;
    const Up up_a = up_[a].load(kRelaxed), up_b = up_[b].load(kRelaxed);
    if (Parent(up_a) == Parent(up_b)) return (Flips(up_a) ^ Flips(up_b)) == differ;  // as mostly
    while (true) {
      const auto [root_a, flips_a] = Climb(a);
      const auto [root_b, flips_b] = Climb(b);
      const Up of_roots = flips_a ^ flips_b ^ differ;
      if (root_a == root_b) return of_roots == 0;
      const std::uint32_t low = std::min(root_a, root_b), high = std::max(root_a, root_b);
      Up root = Pack(high, 0);
      if (up_[high].compare_exchange_strong(root, Pack(low, of_roots), kRelaxed)) return true;
      // Another thread has tied that root meanwhile.
    }
  }

  std::uint64_t CountTrees() const {
    std::uint64_t trees = 0;
    for (std::uint32_t v = 0; v < vertices_; ++v) trees += Parent(up_[v].load(kRelaxed)) == v;
    return trees;
  }

 private:
  // The parent (a root is its own), and in the lowest bit whether the two are oriented oppositely:
  // one word, so that no thread reads half of it. Threads share nothing else.
  using Up = std::uint64_t;
  static constexpr auto kRelaxed = std::memory_order_relaxed;
  static Up Pack(std::uint32_t parent, Up flips) { return Up{parent} << 1 | flips; }
  static std::uint32_t Parent(Up up) { return static_cast<std::uint32_t>(up >> 1); }
  static Up Flips(Up up) { return up & 1; }

  // Returns the root, and whether v is oriented oppositely to it. Halves the path there.
  std::pair<std::uint32_t, Up> Climb(std::uint32_t v) {
    Up flips = 0;
    while (true) {
      Up up = up_[v].load(kRelaxed);
      const std::uint32_t parent = Parent(up);
      if (parent == v) return {v, flips};
      const Up above = up_[parent].load(kRelaxed);
      const Up both = Flips(up) ^ Flips(above);
      if (Parent(above) != parent)
        up_[v].compare_exchange_weak(up, Pack(Parent(above), both), kRelaxed);
      flips ^= both;
      v = Parent(above);
    }
  }

  std::uint32_t vertices_;
  std::unique_ptr<std::atomic<Up>[]> up_;
};

}  // namespace

std::string NameSimplex(const std::uint32_t* ids, int count) {
  std::string name = "(";
  for (int i = 0; i < count; ++i) name += Message(i > 0 ? " " : "", ids[i]);
  return name + ")";
}

std::string CheckSimplexList(const SimplexList& list) {
  const std::size_t width = static_cast<std::size_t>(list.k) + 1;
  if (list.ids->size() % width != 0) {
    return Message("the simplex list holds ", list.ids->size(),
                   " ids, not a multiple of k + 1 = ", width);
  }
  if (list.ids->size() / width >= Adjacency::kNone - 1) {
    return Message("the mesh has ", list.ids->size() / width, " simplices, too many to check");
  }
  std::vector<std::uint32_t> first(ChunkCount(list.size()), list.size());  // by chunk
  ParallelChunks(list.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (auto s = static_cast<std::uint32_t>(begin); s < end; ++s) {
      const std::uint32_t* ids = list[s];
      bool good = ids[list.k] < list.vertices;
      for (int i = 1; i <= list.k; ++i) good = good && ids[i - 1] < ids[i];
      if (good) continue;
      first[chunk] = s;
      return;
    }
  });
  const auto bad =
      std::find_if(first.begin(), first.end(), [&](std::uint32_t s) { return s < list.size(); });
  if (bad == first.end()) return "";
  return Message("simplex ", *bad, " ", NameSimplex(list[*bad], list.k + 1),
                 " does not name ascending vertices below ", list.vertices);
}

VertexStars::VertexStars(const SimplexList& list) : list_(list) {
  begin_.assign(static_cast<std::size_t>(list_.vertices) + 1, 0);
  for (std::size_t i = 0; i < list_.ids->size(); ++i) {
    CheckInterruption(i);
    ++begin_[(*list_.ids)[i] + 1];
  }
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  incident_.resize(list_.ids->size());
  std::vector<std::uint64_t> next(begin_.begin(), begin_.end() - 1);
  for (std::uint32_t s = 0; s < list_.size(); ++s) {
    CheckInterruption(s);
    for (int i = 0; i <= list_.k; ++i) incident_[next[list_[s][i]]++] = s;
  }
}

Adjacency::Adjacency(VertexStars stars, std::uint32_t apex) : VertexStars(std::move(stars)) {
  MatchFacets(apex);
}

// Each facet is matched at its lowest vertex, among the few that share it: parts of the vertices
// write to different places.
void Adjacency::MatchFacets(std::uint32_t apex) {
  const SimplexList& list = this->list();
  across_.assign(list.ids->size(), kNone);
  std::vector<FacetCount> parts(ChunkCount(list.vertices));
  ParallelChunks(list.vertices, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    parts[chunk] = WithMeshDimension(list.k, [&](auto k) {
      return MatchFacetsOf<k()>(static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end),
                                apex);
    });
  });
  for (FacetCount& part : parts) {
    ThrowIfInterrupted();
    facets_.all += part.all;
    if (facets_.bad == 0) facets_.first_bad = std::move(part.first_bad);
    facets_.bad += part.bad;
    AppendFirst(part.some_bad, Violations::kMost * static_cast<std::size_t>(list.k),
                &facets_.some_bad);
  }
}

template <int K>
Adjacency::FacetCount Adjacency::MatchFacetsOf(std::uint32_t begin, std::uint32_t end,
                                               std::uint32_t apex) {
  const SimplexList& list = this->list();
  FacetCount count;
  std::vector<FacetSide<K>> sides;
  for (std::uint32_t v = begin; v < end; ++v) {
    if (K == 1 && v == apex) continue;
    sides.clear();
    for (const std::uint32_t s : Star(v)) {
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
      ++count.all;
      const FacetSide<K>& a = sides[i];
      const FacetSide<K>& b = sides[next - 1];
      // Two copies of one simplex share all facets, yet bound nothing.
      const bool good =
          next - i == 2 && list[a.simplex()][a.omitted()] != list[b.simplex()][b.omitted()];
      if (good) {
        across_[static_cast<std::size_t>(a.simplex()) * (K + 1) + a.omitted()] = b.simplex();
        across_[static_cast<std::size_t>(b.simplex()) * (K + 1) + b.omitted()] = a.simplex();
      } else if (count.bad++ < Violations::kMost) {
        std::array<std::uint32_t, K> ids{};
        std::remove_copy(list[a.simplex()], list[a.simplex()] + K + 1, ids.begin(),
                         list[a.simplex()][a.omitted()]);
        count.some_bad.insert(count.some_bad.end(), ids.begin(), ids.end());
        if (count.bad == 1)
          count.first_bad = Message("face ", NameSimplex(ids.data(), K), " is in ", next - i,
                                    next - i == 1 ? " simplex" : " simplices",
                                    next - i == 2 ? " that are the same" : "");
      }
      i = next;
    }
  }
  return count;
}

Connectivity ComputeConnectivity(const Adjacency& adjacency) {
  const SimplexList& list = adjacency.list();
  Connectivity result;
  const std::size_t parts = Orient(adjacency, result);
  for (std::uint32_t v = 0; v < list.vertices; ++v) {
    CheckInterruption(v);
    if (!adjacency.Star(v).empty()) continue;
    if (result.isolated_vertices++ < Violations::kMost) result.some_isolated.push_back(v);
  }
  // Parts that no facet joins may still meet in smaller faces.
  result.components = parts > 1 ? CountComponents(adjacency) : parts;
  return result;
}

Connectivity ComputeConnectivity(const SimplexList& list, std::span<const std::uint8_t> sides) {
  VertexForest forest(list.vertices);
  std::atomic<bool> orientable = true;
  ParallelFor(list.size(), [&](std::uint32_t s) {
    const std::uint32_t* ids = list[s];
    for (int i = 1; i <= list.k; ++i) {
      const bool flips = ((sides[s] ^ sides[s] >> i) & 1) != 0;
      if (!forest.Join(ids[0], ids[i], flips)) orientable = false;
    }
  });
  Connectivity result;
  result.orientable = orientable;
  result.components = forest.CountTrees();
  return result;
}

}  // namespace stellate::core
