#include "core/geometry/restricted_voronoi_cell.h"

#include <utility>

namespace stellate::core {
namespace {

// Solves the K x K system rows . x = rhs by elimination with partial pivoting. False if singular.
template <int K>
bool Solve(double (&m)[K][K + 1], double* x) {
  for (int c = 0; c < K; ++c) {
    int pivot = c;
    for (int r = c + 1; r < K; ++r)
      if (std::abs(m[r][c]) > std::abs(m[pivot][c])) pivot = r;
    if (m[pivot][c] == 0) return false;
    if (pivot != c) std::swap(m[pivot], m[c]);
    const double inverse = 1.0 / m[c][c];
    for (int r = c + 1; r < K; ++r) {
      const double factor = m[r][c] * inverse;
      for (int j = c + 1; j <= K; ++j) m[r][j] -= factor * m[c][j];
    }
  }
  for (int r = K - 1; r >= 0; --r) {
    double s = m[r][K];
    for (int j = r + 1; j < K; ++j) s -= m[r][j] * x[j];
    x[r] = s / m[r][r];
  }
  return true;
}

template <>
bool Solve<2>(double (&m)[2][3], double* x) {
  const double det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
  if (det == 0) return false;
  const double inverse = 1.0 / det;
  x[0] = (m[0][2] * m[1][1] - m[0][1] * m[1][2]) * inverse;
  x[1] = (m[0][0] * m[1][2] - m[0][2] * m[1][0]) * inverse;
  return true;
}

// A point of an edge is no farther from p than the edge's farther end: this share is far above
// rounding in a well-conditioned solve and far below any distance that matters.
constexpr double kSlack = 1e-9;
// A judged cell is no convex polytope, and its edges' ends are only about where the facets meet.
constexpr double kJudgedSlack = 3;

// Cells are many and small, and hardly grow: no doubling.
template <typename Item>
void Grow(std::vector<Item>& items, std::size_t size) {
  if (items.capacity() < size) items.reserve(size + 1);
  items.resize(size);
}

}  // namespace

template <int K>
void RestrictedVoronoiCell<K>::Reset(double inradius, const Judge* judge) {
  // Vertices of a regular simplex, one coordinate at a time: all unit vectors, all pairwise dot
  // products -1/K.
  double n[K + 1][K] = {};
  for (int a = 0; a < K; ++a) {
    double rest = 1;
    for (int b = 0; b < a; ++b) rest -= n[a][b] * n[a][b];
    n[a][a] = std::sqrt(rest);
    for (int i = a + 1; i <= K; ++i) {
      double s = -1.0 / K;
      for (int b = 0; b < a; ++b) s -= n[a][b] * n[i][b];
      n[i][a] = s / n[a][a];
    }
  }
  facets_.resize(K + 1);
  vertices_.resize(K + 1);
  for (int i = 0; i <= K; ++i) facets_[i].id = kFirstFakeId + static_cast<std::uint32_t>(i);
  for (int i = 0; i <= K; ++i) {
    for (int a = 0; a < K; ++a) {
      facets_[i].normal[a] = n[i][a] * inradius;
      vertices_[i].x[a] = -n[i][a] * inradius * K;
    }
    facets_[i].offset = inradius * inradius;
    facets_[i].vertices = K;
    vertices_[i].norm2 = inradius * inradius * K * K;
    vertices_[i].key = 0;
    vertices_[i].judged = false;
    for (int j = 0, slot = 0; j <= K; ++j) {
      if (j == i) continue;
      vertices_[i].key += Mix64(facets_[static_cast<std::size_t>(j)].id);
      vertices_[i].facet[slot] = static_cast<Index>(j);  // vertex i is on all facets but facet i
      vertices_[i].adjacent[slot] = static_cast<Index>(j);
      ++slot;
    }
  }
  max_norm2_ = inradius * inradius * K * K;
  has_fake_ = true;
  if (!judge) return;
  const auto d = static_cast<std::size_t>(judge->d());
  centres_.resize((K + 1) * d);
  for (std::size_t i = 0; i <= K; ++i) judge->Lift(vertices_[i], centres_.data() + i * d);
}

// The coordinates come from the facets alone, in the order of their ids, so that they do not
// depend on the order of the cuts. Where the facets are too nearly parallel for that, the point is
// interpolated on the edge that the cut crosses. `slack`: how much farther from p than the edge's
// farther end the point may lie.
template <int K>
void RestrictedVoronoiCell<K>::Locate(Vertex& v, const Vertex& kept, const Vertex& removed,
                                      double s, double t, double slack) const {
  Index order[K];
  std::copy(v.facet, v.facet + K, order);
  for (int i = 1; i < K; ++i)
    for (int j = i; j > 0 && facets_[order[j]].id < facets_[order[j - 1]].id; --j)
      std::swap(order[j], order[j - 1]);
  double m[K][K + 1];
  for (int r = 0; r < K; ++r) {
    const Facet& f = facets_[order[r]];
    for (int a = 0; a < K; ++a) m[r][a] = f.normal[a];
    m[r][K] = f.offset;
  }
  const bool solved = Solve<K>(m, v.x);
  v.norm2 = 0;
  for (int a = 0; a < K; ++a) v.norm2 += v.x[a] * v.x[a];
  const double farther = std::max(kept.norm2, removed.norm2);
  if (!solved || !(v.norm2 <= farther * (1 + slack))) {
    const double u = t > s ? -s / (t - s) : 0.0;  // s <= 0 < t: excess at kept, at removed
    v.norm2 = 0;
    for (int a = 0; a < K; ++a) {
      v.x[a] = kept.x[a] + u * (removed.x[a] - kept.x[a]);
      v.norm2 += v.x[a] * v.x[a];
    }
  }
}

template <int K>
void RestrictedVoronoiCell<K>::SetKey(Vertex& v) const {
  v.key = 0;
  for (const Index f : v.facet) v.key += Mix64(facets_[f].id);
}

template <int K>
bool RestrictedVoronoiCell<K>::Clip(std::uint32_t id, const double* normal, double offset,
                                    Scratch& scratch, const Judge* judge, const double* step) {
  const std::size_t old_count = vertices_.size();
  if (scratch.excess.size() < old_count) scratch.excess.resize(2 * old_count);
  double* const excess = scratch.excess.data();
  std::size_t worst = 0;
  for (std::size_t i = 0; i < old_count; ++i) {
    excess[i] = Excess(i, normal, offset, judge, step);
    if (excess[i] > excess[worst]) worst = i;
  }
  if (!(excess[worst] > 0)) return false;
  Facet facet;
  std::copy(normal, normal + K, facet.normal);
  facet.offset = offset;
  facet.id = id;
  facet.vertices = 0;
  if constexpr (K == 2) {
    if (!judge) return ClipPolygon(facet, worst, scratch);
  }

  // What a plane cuts off a polytope is connected: take the part around the worst vertex, and
  // leave what only rounding put beyond the plane.
  scratch.cut.assign(old_count, 0);
  scratch.stack.assign(1, static_cast<Index>(worst));
  scratch.cut[worst] = 1;
  while (!scratch.stack.empty()) {
    const Index v = scratch.stack.back();
    scratch.stack.pop_back();
    for (const Index w : vertices_[v].adjacent) {
      if (scratch.cut[w] || !(excess[w] > 0)) continue;
      scratch.cut[w] = 1;
      scratch.stack.push_back(w);
    }
  }
  if (judge && !Tidy(scratch)) return false;
  scratch.crossings.clear();
  scratch.removed.clear();
  for (std::size_t v = 0; v < old_count; ++v) {
    if (!scratch.cut[v]) continue;
    scratch.removed.push_back(static_cast<Index>(v));
    for (int s = 0; s < K; ++s) {
      const Index w = vertices_[v].adjacent[s];
      if (!scratch.cut[w])
        scratch.crossings.push_back({w, 0, static_cast<Index>(v), static_cast<Index>(s)});
    }
  }
  if (scratch.removed.size() == old_count) return false;

  // One new vertex on each edge that crosses the plane. Its slot 0 holds the new facet, so that
  // adjacent[0] is the kept end of the edge; the edge's facets follow.
  const Index new_facet = static_cast<Index>(facets_.size());
  Grow(facets_, facets_.size() + 1);
  facets_.back() = facet;
  Grow(vertices_, old_count + scratch.crossings.size());
  for (std::size_t c = 0; c < scratch.crossings.size(); ++c) {
    auto& crossing = scratch.crossings[c];
    const Index created = static_cast<Index>(old_count + c);
    Vertex& removed = vertices_[crossing.removed];
    Vertex& kept = vertices_[crossing.kept];
    Vertex& v = vertices_[created];
    v.facet[0] = new_facet;
    v.adjacent[0] = crossing.kept;
    if constexpr (K > 1) {
      for (int s = 0, i = 1; s < K; ++s)
        if (s != crossing.slot) v.facet[i++] = removed.facet[s];
    }
    for (int s = 0; s < K; ++s) {
      // The slot of kept's edge to `removed`: its facet is not on the edge.
      if (kept.adjacent[s] == crossing.removed &&
          std::find(v.facet + 1, v.facet + K, kept.facet[s]) == v.facet + K) {
        crossing.kept_slot = static_cast<Index>(s);
        kept.adjacent[s] = created;
        break;
      }
    }
    removed.adjacent[crossing.slot] = created;
  }
  if (!Stitch(scratch, old_count)) {
    for (const auto& crossing : scratch.crossings) {
      vertices_[crossing.kept].adjacent[crossing.kept_slot] = crossing.removed;
      vertices_[crossing.removed].adjacent[crossing.slot] = crossing.kept;
    }
    vertices_.resize(old_count);
    facets_.pop_back();
    return false;
  }
  const std::size_t d = judge ? static_cast<std::size_t>(judge->d()) : 0;
  Grow(centres_, vertices_.size() * d);
  for (std::size_t c = 0; c < scratch.crossings.size(); ++c) {
    const auto& crossing = scratch.crossings[c];
    Vertex& v = vertices_[old_count + c];
    SetKey(v);
    double* const centre = centres_.data() + (old_count + c) * d;
    v.judged = judge && judge->Centre(*this, v, centre);
    if (v.judged) continue;
    Locate(v, vertices_[crossing.kept], vertices_[crossing.removed], excess[crossing.kept],
           excess[crossing.removed], judge ? kJudgedSlack : kSlack);
    if (judge) judge->Lift(v, centre);
  }
  for (const Index v : scratch.removed)
    for (const Index f : vertices_[v].facet) --facets_[f].vertices;
  for (std::size_t v = old_count; v < vertices_.size(); ++v)
    for (const Index f : vertices_[v].facet) ++facets_[f].vertices;
  for (auto v = scratch.removed.rbegin(); v != scratch.removed.rend(); ++v) DropVertex(*v, d);
  DropFacets();
  Measure();
  return true;
}

// What is cut off a polygon is a chain, and two new vertices close the gap.
template <int K>
bool RestrictedVoronoiCell<K>::ClipPolygon(const Facet& facet, std::size_t worst,
                                           Scratch& scratch) requires(K == 2) {
  const double* const excess = scratch.excess.data();
  const std::size_t count = vertices_.size();
  auto& removed = scratch.removed;
  removed.assign(1, static_cast<Index>(worst));
  struct End {
    Index last, slot;       // of the chain, and its slot of the edge that leaves it
    Index kept, kept_slot;  // that edge's other end
    Index created;          // the vertex that comes between
  } ends[2];
  for (Index side = 0; side < 2; ++side) {
    End& end = ends[side];
    end.last = static_cast<Index>(worst);
    end.slot = side;
    end.kept = vertices_[worst].adjacent[side];
    while (excess[end.kept] > 0) {
      if (removed.size() + 1 == count) return false;
      const Index from = end.last;
      end.last = end.kept;
      removed.push_back(end.last);
      end.slot = vertices_[end.last].adjacent[0] == from;
      end.kept = vertices_[end.last].adjacent[end.slot];
    }
    end.kept_slot = vertices_[end.kept].adjacent[0] != end.last;
  }
  // The new facet takes the place of one that goes, and the new vertices those of cut ones.
  Index created_facet = static_cast<Index>(facets_.size());
  for (const Index v : removed)
    for (const Index f : vertices_[v].facet)
      if (--facets_[f].vertices == 0) created_facet = std::min(created_facet, f);
  if (created_facet == facets_.size()) Grow(facets_, facets_.size() + 1);
  facets_[created_facet] = facet;
  facets_[created_facet].vertices = 2;
  Vertex created[2];
  for (int e = 0; e < 2; ++e) {
    const End& end = ends[e];
    const Vertex& last = vertices_[end.last];
    created[e].judged = false;
    created[e].facet[0] = created_facet;
    created[e].facet[1] = last.facet[1 - end.slot];
    ++facets_[created[e].facet[1]].vertices;
    SetKey(created[e]);
    Locate(created[e], vertices_[end.kept], last, excess[end.kept], excess[end.last], kSlack);
  }
  ends[0].created = removed[0];
  if (removed.size() > 1) {
    ends[1].created = removed[1];
  } else {
    ends[1].created = static_cast<Index>(count);
    Grow(vertices_, count + 1);
  }
  for (int e = 0; e < 2; ++e) {
    created[e].adjacent[0] = ends[e].kept;
    created[e].adjacent[1] = ends[1 - e].created;
    vertices_[ends[e].kept].adjacent[ends[e].kept_slot] = ends[e].created;
  }
  for (int e = 0; e < 2; ++e) vertices_[ends[e].created] = created[e];
  if (removed.size() > 2) {
    std::sort(removed.begin() + 2, removed.end());
    for (std::size_t i = removed.size(); i-- > 2;) DropVertex(removed[i], 0);
    DropFacets();
  }
  Measure();
  return true;
}

// Makes each vertex on the new facet a neighbour of its K-1 others: around each two-dimensional
// face, walk from the removed end of one crossing edge through removed vertices to the next
// crossing edge. False where that goes in circles: what was cut off is no ball.
template <int K>
bool RestrictedVoronoiCell<K>::Stitch(const Scratch& scratch, std::size_t old_count) {
  for (std::size_t c = 0; c < scratch.crossings.size(); ++c) {
    Vertex& v = vertices_[old_count + c];
    for (int i = 1; i < K; ++i) {
      Index at = scratch.crossings[c].removed;
      Index entered = vertices_[at].facet[scratch.crossings[c].slot];  // not on the edge behind
      Index drop = v.facet[i];
      for (std::size_t steps = 0;; ++steps) {
        const Vertex& here = vertices_[at];
        const int s = static_cast<int>(std::find(here.facet, here.facet + K, drop) - here.facet);
        if (s == K || steps > old_count) return false;
        const Index next = here.adjacent[s];
        if (next >= old_count) {
          v.adjacent[i] = next;
          break;
        }
        // On `next` one facet is new to the walk; the one to drop there is the one entered by here.
        drop = entered;
        const Vertex& there = vertices_[next];
        for (int r = 0; r < K; ++r)
          if (std::find(here.facet, here.facet + K, there.facet[r]) == here.facet + K)
            entered = there.facet[r];
        at = next;
      }
    }
  }
  return true;
}

// A judged cell is no convex polytope: a ball may take a bite that leaves a facet in pieces. Keeps
// of each facet, and of the whole, the largest piece. False if nothing is left.
template <int K>
bool RestrictedVoronoiCell<K>::Tidy(Scratch& scratch) const {
  const std::size_t count = vertices_.size();
  constexpr std::size_t kWhole = static_cast<std::size_t>(-1);
  const auto on = [&](const Vertex& v, std::size_t facet) {
    return facet == kWhole ||
           std::find(v.facet, v.facet + K, static_cast<Index>(facet)) != v.facet + K;
  };
  // Cuts off all but the largest piece; says whether anything was.
  const auto keep_largest = [&](std::size_t facet) {
    auto& seen = scratch.seen;
    seen.assign(count, 0);
    auto& pieces = scratch.pieces;
    pieces.clear();
    for (std::size_t start = 0; start < count; ++start) {
      if (scratch.cut[start] || seen[start] || !on(vertices_[start], facet)) continue;
      pieces.emplace_back(1, static_cast<Index>(start));
      seen[start] = 1;
      for (std::size_t i = 0; i < pieces.back().size(); ++i) {
        for (const Index w : vertices_[pieces.back()[i]].adjacent) {
          if (scratch.cut[w] || seen[w] || !on(vertices_[w], facet)) continue;
          seen[w] = 1;
          pieces.back().push_back(w);
        }
      }
    }
    if (pieces.size() < 2) return false;
    std::size_t largest = 0;
    for (std::size_t i = 1; i < pieces.size(); ++i)
      if (pieces[i].size() > pieces[largest].size()) largest = i;
    for (std::size_t i = 0; i < pieces.size(); ++i)
      if (i != largest)
        for (const Index v : pieces[i]) scratch.cut[v] = 1;
    return true;
  };
  // The pieces of a polygon are counted by the edges that the cut crosses: two is one piece.
  std::vector<std::uint16_t>& crossed = scratch.crossed;
  for (bool again = true; again;) {
    again = keep_largest(kWhole);
    crossed.assign(facets_.size(), 0);
    for (std::size_t i = 0; i < count; ++i) {
      if (!scratch.cut[i]) continue;
      for (int s = 0; s < K; ++s) {
        if (scratch.cut[vertices_[i].adjacent[s]]) continue;
        for (int r = 0; r < K; ++r)
          if (r != s) ++crossed[vertices_[i].facet[r]];
      }
    }
    for (std::size_t f = 0; f < facets_.size(); ++f)
      if (crossed[f] > (K <= 3 ? 2 : 0)) again |= keep_largest(f);
  }
  return std::find(scratch.cut.begin(), scratch.cut.end(), 0) != scratch.cut.end();
}

// The last vertex takes the place of one that no other is a neighbour of any more.
template <int K>
void RestrictedVoronoiCell<K>::DropVertex(std::size_t v, std::size_t d) {
  const std::size_t last = vertices_.size() - 1;
  if (v != last) {
    for (const Index w : vertices_[last].adjacent)
      for (Index& back : vertices_[w].adjacent)
        if (back == last) back = static_cast<Index>(v);
    vertices_[v] = vertices_[last];
    std::copy_n(centres_.data() + last * d, d, centres_.data() + v * d);
  }
  vertices_.pop_back();
  centres_.resize(last * d);
}

// Drops the facets that no vertex is left on.
template <int K>
void RestrictedVoronoiCell<K>::DropFacets() {
  for (std::size_t f = facets_.size(); f-- > 0;) {
    if (facets_[f].vertices > 0) continue;
    const std::size_t last = facets_.size() - 1;
    if (f != last) {
      facets_[f] = facets_[last];
      for (Vertex& v : vertices_)
        for (Index& g : v.facet)
          if (g == last) g = static_cast<Index>(f);
    }
    facets_.pop_back();
  }
}

template <int K>
void RestrictedVoronoiCell<K>::Measure() {
  max_norm2_ = 0;
  for (const Vertex& v : vertices_) max_norm2_ = std::max(max_norm2_, v.norm2);
  has_fake_ = false;
  for (const Facet& f : facets_) has_fake_ |= IsFake(f.id);
}

template class RestrictedVoronoiCell<1>;
template class RestrictedVoronoiCell<2>;
template class RestrictedVoronoiCell<3>;
template class RestrictedVoronoiCell<4>;
template class RestrictedVoronoiCell<5>;

}  // namespace stellate::core
