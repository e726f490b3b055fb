#include "core/certificate/complex/topology.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <numeric>
#include <utility>

#include "core/base/first_ids.h"
#include "core/base/instantiate.h"
#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/certificate/complex/facets.h"
#include "core/certificate/complex/signed_forest.h"
#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {
namespace {

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
  const auto match = [&](std::span<const SimplexFacet<K>> facet) {
    ++count.all;
    const SimplexFacet<K>& a = facet.front();
    const SimplexFacet<K>& b = facet.back();
    // Two copies of one simplex share all facets, yet bound nothing.
    const bool good =
        facet.size() == 2 && list[a.simplex()][a.omitted()] != list[b.simplex()][b.omitted()];
    if (good) {
      across_[static_cast<std::size_t>(a.simplex()) * (K + 1) + a.omitted()] = b.simplex();
      across_[static_cast<std::size_t>(b.simplex()) * (K + 1) + b.omitted()] = a.simplex();
    } else if (count.bad++ < Violations::kMost) {
      std::array<std::uint32_t, K> ids{};
      std::remove_copy(list[a.simplex()], list[a.simplex()] + K + 1, ids.begin(),
                       list[a.simplex()][a.omitted()]);
      count.some_bad.insert(count.some_bad.end(), ids.begin(), ids.end());
      if (count.bad == 1)
        count.first_bad = Message("face ", NameSimplex(ids.data(), K), " is in ", facet.size(),
                                  facet.size() == 1 ? " simplex" : " simplices",
                                  facet.size() == 2 ? " that are the same" : "");
    }
  };
  ForEachFacet<K>(*this, begin, end, apex, match);
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
  SignedForest forest(list.vertices);
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
