#include "core/certificate/complex/closed_betti.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <numeric>
#include <utility>

#include "core/base/interruption.h"
#include "core/certificate/complex/parts.h"

namespace stellate::core {
namespace {

constexpr std::uint32_t kMostSimplices = 1'000'000;

using Triangle = std::array<std::uint32_t, 3>;

// The triangles of a closed 3-manifold without one tetrahedron of each component, after all other
// tetrahedra have collapsed: each in turn through a triangle into one before. `vertices`: counts
// those that are used.
std::vector<Triangle> CollapseTetrahedra(const Adjacency& adjacency, std::int64_t* vertices) {
  const SimplexList& list = adjacency.list();
  std::vector<std::uint8_t> seen(list.size()), crossed(list.size()), used(list.vertices);
  std::vector<std::uint32_t> queue;
  for (std::uint32_t first = 0; first < list.size(); ++first) {
    if (seen[first]) continue;
    seen[first] = 1;
    queue.assign(1, first);
    for (std::size_t next = 0; next < queue.size(); ++next) {
      CheckInterruption(next);
      const std::uint32_t s = queue[next];
      for (int i = 0; i < 4; ++i) {
        const std::uint32_t t = adjacency.Across(s, i);
        if (t == VertexStars::kNone || seen[t]) continue;
        seen[t] = 1;
        crossed[s] = static_cast<std::uint8_t>(crossed[s] | 1u << i);
        crossed[t] = static_cast<std::uint8_t>(crossed[t] | 1u << adjacency.Apex(s, t));
        queue.push_back(t);
      }
    }
  }
  std::vector<Triangle> triangles;
  for (std::uint32_t s = 0; s < list.size(); ++s)
    for (std::size_t i = 0; i < 4; ++i) {
      used[list[s][i]] = 1;
      if ((crossed[s] >> i & 1u) != 0 || adjacency.Across(s, static_cast<int>(i)) < s) continue;
      Triangle triangle;
      std::copy_n(list[s], i, triangle.begin());
      std::copy(list[s] + i + 1, list[s] + 4, triangle.begin() + static_cast<std::ptrdiff_t>(i));
      triangles.push_back(triangle);
    }
  *vertices = std::count(used.begin(), used.end(), 1);
  return triangles;
}

// A complex of triangles and their edges, from which triangles collapse through edges in no other.
class Spine {
 public:
  // `vertices`: more than any id.
  Spine(const std::vector<Triangle>& triangles, std::size_t vertices) {
    NumberEdges(triangles, vertices);
    ListSides();
    Collapse();
  }

  std::int64_t edges() const {  // that are left
    return std::count(gone_.begin(), gone_.end(), 0);
  }

  // Returns the rank of the boundary matrix of the triangles over Z/2. An edge in two triangles
  // eliminates one of them: what hangs together by such edges is a sheet, with one row, the sum of
  // its triangles'. What is left are the columns of edges in three triangles or more; along a curve
  // where sheets meet they are alike.
  std::int64_t BoundaryRank() const {
    Parts sheets(triangles_.size());
    std::int64_t rank = 0;
    for (std::uint32_t e = 0; e + 1 < begin_.size(); ++e) {
      CheckInterruption(e);
      if (gone_[e] || degree_[e] != 2) continue;
      const std::vector<std::uint32_t> two = At(e);
      if (sheets.Root(two[0]) == sheets.Root(two[1])) continue;
      sheets.Join(two[0], two[1]);
      ++rank;
    }
    std::map<std::size_t, std::vector<std::size_t>> columns;  // by the last row of each
    for (std::uint32_t e = 0; e + 1 < begin_.size(); ++e) {
      CheckInterruption(e);
      if (gone_[e] || degree_[e] < 3) continue;
      std::vector<std::size_t> column;
      for (const std::uint32_t t : At(e)) column = Sum(column, {sheets.Root(t)});
      while (!column.empty()) {
        const auto [other, fresh] = columns.emplace(column.back(), column);
        if (fresh) break;
        column = Sum(column, other->second);
      }
    }
    return rank + static_cast<std::int64_t>(columns.size());
  }

 private:
  void NumberEdges(const std::vector<Triangle>& triangles, std::size_t vertices) {
    // By the low end, then by the other, and then by triangle.
    struct Side {
      std::uint32_t high, triangle;
      bool operator<(const Side& other) const {
        return std::pair(high, triangle) < std::pair(other.high, other.triangle);
      }
    };
    const auto for_each_side = [&](const auto& visit) {
      for (std::uint32_t t = 0; t < triangles.size(); ++t)
        for (std::size_t i = 0; i < 3; ++i)
          visit(triangles[t][i == 0], Side{triangles[t][i == 2 ? 1 : 2], t});
    };
    std::vector<std::size_t> next(vertices + 1);  // by low end; where its next side goes
    for_each_side([&](std::uint32_t low, const Side&) { ++next[low + 1]; });
    std::partial_sum(next.begin(), next.end(), next.begin());
    std::vector<Side> sides(3 * triangles.size());
    for_each_side([&](std::uint32_t low, const Side& side) { sides[next[low]++] = side; });
    triangles_.resize(triangles.size());
    at_.reserve(sides.size());
    std::vector<std::uint8_t> count(triangles.size());
    for (std::size_t v = 0, begin = 0; v < vertices; begin = next[v++]) {
      CheckInterruption(v);
      std::sort(sides.data() + begin, sides.data() + next[v]);
      for (std::size_t i = begin; i < next[v]; ++i) {
        if (i == begin || sides[i].high != sides[i - 1].high) begin_.push_back(at_.size());
        const std::uint32_t t = sides[i].triangle;
        triangles_[t][count[t]++] = static_cast<std::uint32_t>(begin_.size() - 1);
        at_.push_back(t);
      }
    }
    begin_.push_back(at_.size());
  }

  void ListSides() {
    gone_.resize(begin_.size() - 1);
    alive_.assign(triangles_.size(), 1);
    for (std::size_t e = 0; e + 1 < begin_.size(); ++e)
      degree_.push_back(static_cast<std::uint32_t>(begin_[e + 1] - begin_[e]));
  }

  void Collapse() {
    std::vector<std::uint32_t> free;
    for (std::uint32_t e = 0; e < degree_.size(); ++e)
      if (degree_[e] == 1) free.push_back(e);
    for (std::size_t next = 0; next < free.size(); ++next) {
      CheckInterruption(next);
      const std::uint32_t e = free[next];
      if (degree_[e] != 1) continue;  // its triangle went through another
      const std::uint32_t t = At(e).front();
      gone_[e] = 1;
      alive_[t] = 0;
      for (const std::uint32_t other : triangles_[t])
        if (--degree_[other] == 1) free.push_back(other);
    }
  }

  // The triangles at an edge that are left.
  std::vector<std::uint32_t> At(std::uint32_t e) const {
    std::vector<std::uint32_t> left;
    for (std::size_t i = begin_[e]; i < begin_[e + 1]; ++i)
      if (alive_[at_[i]]) left.push_back(at_[i]);
    return left;
  }

  static std::vector<std::size_t> Sum(const std::vector<std::size_t>& a,
                                      const std::vector<std::size_t>& b) {
    std::vector<std::size_t> sum;
    std::set_symmetric_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(sum));
    return sum;
  }

  std::vector<Triangle> triangles_;  // by edges
  std::vector<std::size_t> begin_;   // by edge: where its triangles are in at_
  std::vector<std::uint32_t> at_, degree_;
  std::vector<std::uint8_t> gone_, alive_;  // by edge; by triangle
};

std::int64_t FirstBetti(const SimplexList& list, std::int64_t components) {
  std::int64_t vertices = 0;
  const Spine spine(CollapseTetrahedra(Adjacency(list), &vertices), list.vertices);
  return spine.edges() - vertices + components - spine.BoundaryRank();
}

}  // namespace

std::vector<std::int64_t> ClosedBettiNumbers(const SimplexList& list, std::int64_t components,
                                             std::int64_t euler_characteristic) {
  if (list.k == 1) return {components, components};
  if (list.k == 2) return {components, 2 * components - euler_characteristic, components};
  if (list.k > 3 || list.size() > kMostSimplices) return {};
  const std::int64_t first = FirstBetti(list, components);
  return {components, first, first, components};
}

}  // namespace stellate::core
