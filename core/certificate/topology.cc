#include "core/certificate/topology.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "core/message.h"
#include "core/parallel.h"
#include "core/specification.h"

namespace stellate::core {
namespace {

// One side of a facet: its vertices but the lowest, and the simplex it bounds.
struct FacetSide {
  std::array<std::uint32_t, kMaxDimension - 1> rest{};
  std::uint32_t simplex = 0;
  std::uint32_t omitted = 0;  // number of the opposite vertex in the simplex

  bool SameFacet(const FacetSide& other) const { return rest == other.rest; }
};

std::uint32_t Root(std::vector<std::uint32_t>& parent, std::uint32_t v) {
  while (parent[v] != v) {
    parent[v] = parent[parent[v]];
    v = parent[v];
  }
  return v;
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
  for (std::uint32_t s = 0; s < list.size(); ++s) {
    LookUp(s);
    const std::uint32_t* ids = list[s];
    for (std::size_t i = 0; i < width; ++i) {
      if (ids[i] >= list.vertices || (i > 0 && ids[i] <= ids[i - 1])) {
        return Message("simplex ", s, " ", NameSimplex(ids, list.k + 1),
                       " does not name ascending vertices below ", list.vertices);
      }
    }
  }
  return "";
}

Adjacency::Adjacency(const SimplexList& list) : list_(list) {
  begin_.assign(static_cast<std::size_t>(list_.vertices) + 1, 0);
  for (std::size_t i = 0; i < list_.ids->size(); ++i) {
    LookUp(i);
    ++begin_[(*list_.ids)[i] + 1];
  }
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  incident_.resize(list_.ids->size());
  std::vector<std::uint64_t> next(begin_.begin(), begin_.end() - 1);
  for (std::uint32_t s = 0; s < list_.size(); ++s) {
    LookUp(s);
    for (int i = 0; i <= list_.k; ++i) incident_[next[list_[s][i]]++] = s;
  }
  MatchFacets();
}

// Each facet is matched at its lowest vertex, among the few that share it: parts of the vertices
// write to different places.
void Adjacency::MatchFacets() {
  across_.assign(list_.ids->size(), kNone);
  std::vector<FacetCount> parts(ChunkCount(list_.vertices));
  ParallelChunks(list_.vertices, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    parts[chunk] =
        MatchFacetsOf(static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end));
  });
  for (FacetCount& part : parts) {
    ThrowIfInterrupted();
    facets_.all += part.all;
    if (facets_.bad == 0) facets_.first_bad = std::move(part.first_bad);
    facets_.bad += part.bad;
  }
}

Adjacency::FacetCount Adjacency::MatchFacetsOf(std::uint32_t begin, std::uint32_t end) {
  const int k = list_.k;
  FacetCount count;
  std::vector<FacetSide> sides;
  for (std::uint32_t v = begin; v < end; ++v) {
    sides.clear();
    for (const std::uint32_t s : Star(v)) {
      const std::uint32_t* ids = list_[s];
      const int lowest_omitted = ids[0] == v ? 1 : 0;
      if (lowest_omitted == 0 && ids[1] != v) continue;
      const int highest_omitted = ids[0] == v ? k : 0;
      for (int omit = lowest_omitted; omit <= highest_omitted; ++omit) {
        FacetSide side;
        side.simplex = s;
        side.omitted = static_cast<std::uint32_t>(omit);
        int rest = 0;
        for (int i = 0; i <= k; ++i) {
          if (i != omit && ids[i] != v) side.rest[rest++] = ids[i];
        }
        sides.push_back(side);
      }
    }
    std::sort(sides.begin(), sides.end(), [](const FacetSide& a, const FacetSide& b) {
      return a.rest != b.rest ? a.rest < b.rest : a.simplex < b.simplex;
    });
    for (std::size_t i = 0; i < sides.size();) {
      std::size_t next = i + 1;
      while (next < sides.size() && sides[next].SameFacet(sides[i])) ++next;
      ++count.all;
      const FacetSide& a = sides[i];
      const FacetSide& b = sides[next - 1];
      // Two copies of one simplex share all facets, yet bound nothing.
      const bool good = next - i == 2 && list_[a.simplex][a.omitted] != list_[b.simplex][b.omitted];
      if (good) {
        across_[static_cast<std::size_t>(a.simplex) * (k + 1) + a.omitted] = b.simplex;
        across_[static_cast<std::size_t>(b.simplex) * (k + 1) + b.omitted] = a.simplex;
      } else if (count.bad++ == 0) {
        std::array<std::uint32_t, kMaxDimension> ids{};
        ids[0] = v;
        std::copy_n(a.rest.begin(), k - 1, ids.begin() + 1);
        count.first_bad = Message("face ", NameSimplex(ids.data(), k), " is in ", next - i,
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
  const int k = list.k;
  Connectivity result;

  std::vector<std::uint32_t> parent(list.vertices);
  std::iota(parent.begin(), parent.end(), 0u);
  for (std::uint32_t s = 0; s < list.size(); ++s) {
    LookUp(s);
    for (int i = 1; i <= k; ++i) {
      const std::uint32_t a = Root(parent, list[s][0]);
      const std::uint32_t b = Root(parent, list[s][i]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  for (std::uint32_t v = 0; v < list.vertices; ++v) {
    LookUp(v);
    if (adjacency.Star(v).empty()) {
      if (result.isolated_vertices++ == 0) result.first_isolated = v;
    } else if (Root(parent, v) == v) {
      ++result.components;
    }
  }

  // Facets inherit opposite orientations from their two sides: sign_s (-1)^i = -sign_t (-1)^j.
  result.orientable = true;
  std::vector<std::int8_t> sign(list.size(), 0);
  std::vector<std::uint32_t> stack;
  std::size_t steps = 0;
  for (std::uint32_t start = 0; start < list.size() && result.orientable; ++start) {
    if (sign[start] != 0) continue;
    sign[start] = 1;
    stack.push_back(start);
    while (!stack.empty()) {
      LookUp(steps++);
      const std::uint32_t s = stack.back();
      stack.pop_back();
      for (int i = 0; i <= k; ++i) {
        const std::uint32_t t = adjacency.Across(s, i);
        if (t == Adjacency::kNone) continue;
        int j = 0;
        // The vertex of t that is not in s.
        while (std::binary_search(list[s], list[s] + k + 1, list[t][j])) ++j;
        const std::int8_t wanted = static_cast<std::int8_t>((i + j) % 2 == 0 ? -sign[s] : sign[s]);
        if (sign[t] == 0) {
          sign[t] = wanted;
          stack.push_back(t);
        } else if (sign[t] != wanted) {
          result.orientable = false;
        }
      }
    }
  }
  return result;
}

}  // namespace stellate::core
