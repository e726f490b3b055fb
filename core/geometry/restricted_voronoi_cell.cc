#include "core/geometry/restricted_voronoi_cell.h"

#include <utility>

#include "core/geometry/half_spaces.h"

namespace stellate::core {
namespace {

// Cells are many and small, and hardly grow: no doubling.
template <typename Item>
void Grow(std::vector<Item>& items, std::size_t size, std::size_t spare) {
  if (items.capacity() < size) items.reserve(size + spare);
  items.resize(size);
}
constexpr std::size_t kSpareFacets = 2;
constexpr std::size_t kSpareVertices = 4;  // what two facets more come with, for K = 3

}  // namespace

template <int K>
void RestrictedVoronoiCell<K>::Reset(double inradius, const Surroundings<K>& around) {
  facets_.resize(K + 1);
  vertices_.resize(K + 1);
  keys_.resize(K + 1);
  for (int i = 0; i <= K; ++i) {
    facets_[i].id = kFirstFakeId + static_cast<std::uint32_t>(i);
    facets_[i].offset = FakeHalfSpace<K>(i, inradius, facets_[i].normal);
    facets_[i].vertices = K;
  }
  for (int i = 0; i <= K; ++i) {
    for (int a = 0; a < K; ++a) vertices_[i].x[a] = -facets_[i].normal[a] * K;
    vertices_[i].norm2 = inradius * inradius * K * K;
    vertices_[i].judged = false;
    for (int j = 0, slot = 0; j <= K; ++j) {
      if (j == i) continue;
      vertices_[i].facet[slot] = static_cast<Index>(j);  // vertex i is on all facets but facet i
      vertices_[i].adjacent[slot] = static_cast<Index>(j);
      ++slot;
    }
    keys_[i] = KeyOf(vertices_[i]);
  }
  max_norm2_ = inradius * inradius * K * K;
  has_fake_ = true;
  d_ = static_cast<std::size_t>(around.judged_in());
  centres_.resize((K + 1) * d_);
  if (d_ == 0) return;
  for (std::size_t i = 0; i <= K; ++i) around.Lift(vertices_[i].x, centres_.data() + i * d_);
}

template <int K>
void RestrictedVoronoiCell<K>::Judge(const Surroundings<K>& around) {
  d_ = static_cast<std::size_t>(around.judged_in());
  centres_.resize(vertices_.size() * d_);
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    Vertex& v = vertices_[i];
    double* const centre = centres_.data() + i * d_;
    std::uint32_t ids[K];
    for (int s = 0; s < K; ++s) ids[s] = facets_[v.facet[s]].id;
    v.judged = around.Centre(ids, keys_[i], v.x, centre);
    if (v.judged)
      DotRows(centre, 1, centre, static_cast<int>(d_), &v.norm2);
    else
      around.Lift(v.x, centre);
  }
  Measure();
}

template <int K>
void RestrictedVoronoiCell<K>::Locate(Vertex& v, const Vertex& kept, const Vertex& removed,
                                      double s, double t, double slack) const {
  HalfSpaceRef<K> planes[K];
  for (int i = 0; i < K; ++i) {
    const Facet& f = facets_[v.facet[i]];
    planes[i] = {f.id, f.normal, f.offset};
  }
  v.norm2 = Meet<K>(planes, {kept.x, kept.norm2, s}, {removed.x, removed.norm2, t}, slack, v.x);
}

template <int K>
std::uint64_t RestrictedVoronoiCell<K>::KeyOf(const Vertex& v) const {
  std::uint64_t key = 0;
  for (const Index f : v.facet) key += Mix64(facets_[f].id);
  return key;
}

template <int K>
std::size_t RestrictedVoronoiCell<K>::Excesses(const double* normal, double offset,
                                               const double* step, double* excess) const {
  const std::size_t count = vertices_.size();
  std::size_t worst = 0;
  const auto take = [&](std::size_t v, double along) {
    excess[v] = along - offset;
    if (excess[v] > excess[worst]) worst = v;
  };
  if (d_ > 0) {
    DotRows(centres_.data(), count, step, static_cast<int>(d_), excess);
    for (std::size_t v = 0; v < count; ++v) take(v, excess[v]);
  } else {
    for (std::size_t v = 0; v < count; ++v) take(v, Dot(normal, vertices_[v].x, K));
  }
  return worst;
}

template <int K>
bool RestrictedVoronoiCell<K>::Clip(std::uint32_t id, const double* normal, double offset,
                                    Scratch& scratch, const Surroundings<K>& around,
                                    const double* step) {
  const std::size_t old_count = vertices_.size();
  if (scratch.excess.size() < old_count) scratch.excess.resize(2 * old_count);
  double* const excess = scratch.excess.data();
  const std::size_t worst = Excesses(normal, offset, step, excess);
  if (!(excess[worst] > 0)) return false;
  Facet facet;
  std::copy(normal, normal + K, facet.normal);
  facet.offset = offset;
  facet.id = id;
  facet.vertices = 0;

  // The part that a plane cuts off a polytope is connected: take the part around the worst vertex,
  // and keep vertices that only rounding put beyond the plane.
  scratch.cut.assign(old_count, 0);
  std::uint8_t* const cut = scratch.cut.data();
  cut[worst] = 1;
  scratch.removed.clear();
  scratch.removed.push_back(static_cast<Index>(worst));
  for (std::size_t i = 0; i < scratch.removed.size(); ++i) {
    for (const Index w : vertices_[scratch.removed[i]].adjacent) {
      if (cut[w] || !(excess[w] > 0)) continue;
      cut[w] = 1;
      scratch.removed.push_back(w);
    }
  }
  if (scratch.removed.size() == old_count) return false;
  std::sort(scratch.removed.begin(), scratch.removed.end());
  FindCrossings(scratch);
  const bool is_disc = IsDisc(scratch);
  if (d_ > 0 && !is_disc) {
    if (!Tidy(scratch)) return false;
    scratch.removed.clear();
    for (std::size_t v = 0; v < old_count; ++v)
      if (scratch.cut[v]) scratch.removed.push_back(static_cast<Index>(v));
    FindCrossings(scratch);
  }

  // One new vertex on each edge that crosses the plane. Its slot 0 holds the new facet, so that
  // adjacent[0] is the kept end of the edge; the edge's facets follow.
  const Index new_facet = static_cast<Index>(facets_.size());
  Grow(facets_, facets_.size() + 1, kSpareFacets);
  facets_.back() = facet;
  Grow(vertices_, old_count + scratch.crossings.size(), kSpareVertices);
  Vertex* const vertices = vertices_.data();
  for (std::size_t c = 0; c < scratch.crossings.size(); ++c) {
    auto& crossing = scratch.crossings[c];
    const Index created = static_cast<Index>(old_count + c);
    Vertex& removed = vertices[crossing.removed];
    Vertex& kept = vertices[crossing.kept];
    Vertex& v = vertices[created];
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
  if (is_disc) {
    Match(scratch, old_count);
  } else if (!Stitch(scratch, old_count)) {
    for (const auto& crossing : scratch.crossings) {
      vertices_[crossing.kept].adjacent[crossing.kept_slot] = crossing.removed;
      vertices_[crossing.removed].adjacent[crossing.slot] = crossing.kept;
    }
    vertices_.resize(old_count);
    facets_.pop_back();
    return false;
  }
  Grow(keys_, vertices_.size(), kSpareVertices);
  const std::uint64_t cut_key = Mix64(id);
  if (d_ > 0) Grow(centres_, vertices_.size() * d_, kSpareVertices * d_);
  for (std::size_t c = 0; c < scratch.crossings.size(); ++c) {
    const auto& crossing = scratch.crossings[c];
    Vertex& v = vertices[old_count + c];
    // The new facet takes the place of the one that the edge's removed end is not on any more.
    const Vertex& removed = vertices[crossing.removed];
    const std::uint64_t key = keys_[old_count + c] =
        keys_[crossing.removed] - Mix64(facets_[removed.facet[crossing.slot]].id) + cut_key;
    double* const centre = centres_.data() + (old_count + c) * d_;
    v.judged = false;
    if (d_ > 0) {
      std::uint32_t ids[K];
      for (int i = 0; i < K; ++i) ids[i] = facets_[v.facet[i]].id;
      v.judged = around.Centre(ids, key, v.x, centre);
      if (v.judged) {
        v.norm2 = Dot(centre, centre, static_cast<int>(d_));
        continue;
      }
    }
    Locate(v, vertices[crossing.kept], removed, excess[crossing.kept], excess[crossing.removed],
           d_ > 0 ? kJudgedSlack : kSlack);
    if (d_ > 0) around.Lift(v.x, centre);
  }
  Facet* const facets = facets_.data();
  for (const Index v : scratch.removed)
    for (const Index f : vertices[v].facet) --facets[f].vertices;
  for (std::size_t v = old_count; v < vertices_.size(); ++v)
    for (const Index f : vertices[v].facet) ++facets[f].vertices;
  for (auto v = scratch.removed.rbegin(); v != scratch.removed.rend(); ++v) DropVertex(*v);
  DropFacets();
  Measure();
  return true;
}

// Finds the edges that the cut crosses, from the removed vertices, ascending.
template <int K>
void RestrictedVoronoiCell<K>::FindCrossings(Scratch& scratch) const {
  scratch.crossings.clear();
  for (const Index v : scratch.removed)
    for (int s = 0; s < K; ++s) {
      const Index w = vertices_[v].adjacent[s];
      if (!scratch.cut[w]) scratch.crossings.push_back({w, 0, v, static_cast<Index>(s)});
    }
}

// Whether, for K = 3, the crossed edges, two on each facet that has any, form one cycle: the
// removed part of the cell's boundary is then a disc, as is the kept one. Notes the two crossings
// on each facet.
template <int K>
bool RestrictedVoronoiCell<K>::IsDisc(Scratch& scratch) const {
  if (K != 3) return false;
  constexpr Index kNone = 0xffff;
  const auto& crossings = scratch.crossings;
  auto& on_facet = scratch.on_facet;
  on_facet.assign(facets_.size(), {kNone, kNone});
  // Calls visit(facet) for the two facets that a crossed edge is on.
  const auto for_each_facet = [&](std::size_t c, const auto& visit) {
    for (int s = 0; s < K; ++s)
      if (s != crossings[c].slot) visit(vertices_[crossings[c].removed].facet[s]);
  };
  bool twice = !crossings.empty();
  for (std::size_t c = 0; c < crossings.size(); ++c) {
    for_each_facet(c, [&](Index f) {
      auto& [first, second] = on_facet[f];
      twice = twice && second == kNone;
      (first == kNone ? first : second) = static_cast<Index>(c);
    });
  }
  if (!twice) return false;
  std::size_t at = 0, steps = 0;
  Index through = kNone;
  do {
    Index next_through = kNone;
    for_each_facet(at, [&](Index f) {
      if (f != through) next_through = f;
    });
    through = next_through;
    const auto& [first, second] = on_facet[through];
    at = first == at ? second : first;
    ++steps;
  } while (at != 0);
  return steps == crossings.size();
}

// Stitch for a removed disc.
template <int K>
void RestrictedVoronoiCell<K>::Match(const Scratch& scratch, std::size_t old_count) {
  for (std::size_t c = 0; c < scratch.crossings.size(); ++c) {
    Vertex& v = vertices_[old_count + c];
    for (int i = 1; i < K; ++i) {
      const auto& [first, second] = scratch.on_facet[v.facet[K - i]];  // the one not dropped
      v.adjacent[i] = static_cast<Index>(old_count + (first == c ? second : first));
    }
  }
}

// Joins each vertex on the new facet to its K-1 neighbours there: around each two-dimensional face,
// walks from the removed end of one crossing edge through removed vertices to the next crossing
// edge. Returns false if the walk does not end: the removed part is no ball.
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

// The last vertex takes the place of one that no other is a neighbour of any more.
template <int K>
void RestrictedVoronoiCell<K>::DropVertex(std::size_t v) {
  const std::size_t last = vertices_.size() - 1;
  if (v != last) {
    Vertex* const vertices = vertices_.data();
    for (const Index w : vertices[last].adjacent)
      for (Index& back : vertices[w].adjacent)
        if (back == last) back = static_cast<Index>(v);
    vertices[v] = vertices[last];
    keys_[v] = keys_[last];
    if (d_ > 0) std::copy_n(centres_.data() + last * d_, d_, centres_.data() + v * d_);
  }
  vertices_.pop_back();
  keys_.pop_back();
  if (d_ > 0) centres_.resize(last * d_);
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
  // A removed part does not come back.
  has_fake_ = has_fake_ && std::any_of(facets_.begin(), facets_.end(),
                                       [](const Facet& f) { return IsFake(f.id); });
}

template <int K>
void RestrictedVoronoiCell<K>::PackTo(std::vector<std::byte>* message) const {
  PackAll(facets_, message);
  PackAll(vertices_, message);
  PackAll(keys_, message);
  PackAll(centres_, message);
  Pack(d_, message);
  Pack(max_norm2_, message);
  Pack(has_fake_, message);
}

template <int K>
void RestrictedVoronoiCell<K>::Unpack(Parcel* parcel) {
  parcel->UnpackAll(&facets_);
  parcel->UnpackAll(&vertices_);
  parcel->UnpackAll(&keys_);
  parcel->UnpackAll(&centres_);
  d_ = parcel->Unpack<std::size_t>();
  max_norm2_ = parcel->Unpack<double>();
  has_fake_ = parcel->Unpack<bool>();
}

template class RestrictedVoronoiCell<1>;
template class RestrictedVoronoiCell<3>;
template class RestrictedVoronoiCell<4>;
STELLATE_ABOVE_3(template class RestrictedVoronoiCell<5>;)

}  // namespace stellate::core
