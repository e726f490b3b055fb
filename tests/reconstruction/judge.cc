#include "tests/reconstruction/judge.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <numeric>
#include <set>

#include "tests/support/homology.h"

namespace stellate::testing {
namespace {

using Face = std::vector<std::uint32_t>;

std::uint32_t Root(std::vector<std::uint32_t>& up, std::uint32_t v) {
  while (up[v] != v) v = up[v] = up[up[v]];
  return v;
}

// All faces of a list of simplices, by dimension, sorted, with repetitions.
std::vector<std::vector<Face>> FacesOf(const std::vector<Face>& simplices, std::size_t width) {
  std::vector<std::vector<Face>> faces(width);
  for (const Face& s : simplices)
    for (unsigned mask = 1; mask < 1u << width; ++mask) {
      Face f;
      for (std::size_t i = 0; i < width; ++i)
        if (mask >> i & 1) f.push_back(s[i]);
      faces[f.size() - 1].push_back(f);
    }
  for (auto& list : faces) std::sort(list.begin(), list.end());
  return faces;
}

std::int64_t EulerOf(std::vector<std::vector<Face>>& faces) {
  std::int64_t euler = 0;
  for (std::size_t j = 0; j < faces.size(); ++j) {
    faces[j].erase(std::unique(faces[j].begin(), faces[j].end()), faces[j].end());
    euler += (j % 2 ? -1 : 1) * static_cast<std::int64_t>(faces[j].size());
  }
  return euler;
}

// A link is a sphere: of dimension 0 two points; a connected closed curve; a connected surface of
// Euler characteristic 2 whose own links are circles, as they are where facets are good.
bool IsSphere(const std::vector<Face>& link, std::size_t width) {
  auto faces = FacesOf(link, width);
  std::set<std::uint32_t> vertices;
  for (const Face& s : link) vertices.insert(s.begin(), s.end());
  if (width == 1) return link.size() == 2 && vertices.size() == 2;
  std::map<std::uint32_t, std::uint32_t> up;
  for (const std::uint32_t v : vertices) up[v] = v;
  const auto root = [&](std::uint32_t v) {
    while (up[v] != v) v = up[v];
    return v;
  };
  for (const Face& s : link)
    for (const std::uint32_t v : s) up[root(v)] = root(s[0]);
  for (const std::uint32_t v : vertices)
    if (root(v) != root(*vertices.begin())) return false;
  if (width == 3) {  // each vertex' own link
    std::map<std::uint32_t, std::vector<Face>> own;
    for (const Face& s : link)
      for (std::size_t i = 0; i < 3; ++i) {
        Face rest = s;
        rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(i));
        own[s[i]].push_back(rest);
      }
    for (const auto& [v, edges] : own)
      if (!IsSphere(edges, 2)) return false;
  } else {
    std::map<std::uint32_t, int> degree;
    for (const Face& s : link)
      for (const std::uint32_t v : s) ++degree[v];
    for (const auto& [v, count] : degree)
      if (count != 2) return false;
  }
  return EulerOf(faces) == (width == 2 ? 0 : 2);
}

bool IsOrientable(const std::vector<Face>& simplices) {
  std::map<Face, std::vector<std::pair<std::size_t, std::size_t>>> sides;
  for (std::size_t s = 0; s < simplices.size(); ++s)
    for (std::size_t i = 0; i < simplices[s].size(); ++i) {
      Face f = simplices[s];
      f.erase(f.begin() + static_cast<std::ptrdiff_t>(i));
      sides[f].emplace_back(s, i);
    }
  std::vector<int> sign(simplices.size(), 0);
  for (std::size_t start = 0; start < simplices.size(); ++start) {
    if (sign[start]) continue;
    sign[start] = 1;
    std::vector<std::size_t> stack{start};
    while (!stack.empty()) {
      const std::size_t s = stack.back();
      stack.pop_back();
      for (std::size_t i = 0; i < simplices[s].size(); ++i) {
        Face f = simplices[s];
        f.erase(f.begin() + static_cast<std::ptrdiff_t>(i));
        for (const auto& [t, j] : sides[f]) {
          if (t == s) continue;
          const int want = (i + j) % 2 == 0 ? -sign[s] : sign[s];
          if (sign[t] == 0) {
            sign[t] = want;
            stack.push_back(t);
          } else if (sign[t] != want) {
            return false;
          }
        }
      }
    }
  }
  return true;
}

}  // namespace

Counted Count(int k, const std::vector<std::uint32_t>& ids, std::uint32_t vertices) {
  Counted counted;
  const auto width = static_cast<std::size_t>(k) + 1;
  std::vector<Face> simplices;
  for (std::size_t at = 0; at + width <= ids.size(); at += width)
    simplices.emplace_back(ids.begin() + static_cast<std::ptrdiff_t>(at),
                           ids.begin() + static_cast<std::ptrdiff_t>(at + width));
  counted.simplices = simplices.size();
  counted.well_formed = ids.size() % width == 0;
  for (const Face& s : simplices) {
    counted.well_formed = counted.well_formed && s.back() < vertices;
    for (std::size_t i = 1; i < width; ++i)
      counted.well_formed = counted.well_formed && s[i - 1] < s[i];
  }
  if (!counted.well_formed) return counted;
  std::vector<Face> sorted = simplices;
  std::sort(sorted.begin(), sorted.end());
  counted.well_formed = std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end();

  auto faces = FacesOf(simplices, width);
  const std::vector<Face>& facets = faces[width - 2];
  for (std::size_t i = 0; i < facets.size();) {
    std::size_t end = i + 1;
    while (end < facets.size() && facets[end] == facets[i]) ++end;
    counted.bad_facets += end - i != 2;
    counted.rim_facets += end - i == 1;
    i = end;
  }
  counted.euler = EulerOf(faces);

  std::vector<std::uint32_t> up(vertices);
  std::iota(up.begin(), up.end(), 0u);
  std::map<std::uint32_t, std::vector<Face>> links;
  for (const Face& s : simplices)
    for (std::size_t i = 0; i < width; ++i) {
      up[Root(up, s[i])] = Root(up, s[0]);
      Face rest = s;
      rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(i));
      links[s[i]].push_back(rest);
    }
  for (const auto& [v, link] : links) {
    counted.components += Root(up, v) == v;
    counted.bad_links += !IsSphere(link, width - 1);
  }
  if (counted.bad_facets == 0) counted.orientable = IsOrientable(simplices);
  return counted;
}

bool IsRight(const Counted& counted, const Sample& sample) {
  return counted.IsClosedManifold() && counted.components == sample.components &&
         counted.euler == sample.euler && counted.orientable == sample.orientable;
}

bool HasHomologyOf(const Sample& sample, const std::vector<std::uint32_t>& simplices) {
  const auto width = static_cast<std::size_t>(sample.k) + 1;
  std::vector<Facet> facets;
  for (std::size_t at = 0; at + width <= simplices.size(); at += width)
    facets.emplace_back(simplices.begin() + static_cast<std::ptrdiff_t>(at),
                        simplices.begin() + static_cast<std::ptrdiff_t>(at + width));
  return BettiNumbers(facets, 2) == sample.betti;
}

}  // namespace stellate::testing
