#include "core/geometry/draft_polytope.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "core/geometry/restricted_voronoi_cell.h"

namespace stellate::core {

DraftPolytope& ThreadPolytope() {
  thread_local const auto polytope = std::make_unique<DraftPolytope>();
  return *polytope;
}

void DraftPolytope::Reset(double inradius) {
  if (inradius != inradius_) {
    inradius_ = inradius;
    for (int i = 0; i < 4; ++i) fake_[i].offset = FakeHalfSpace<3>(i, inradius, fake_[i].normal);
  }
  gave_up_ = false;
  facet_count_ = vertex_count_ = 4;
  max_norm2_ = inradius * inradius * 3 * 3;
  for (std::uint8_t i = 0; i < 4; ++i) {
    facets_[i] = fake_[i];
    facets_[i].id = kFirstFakeId + i;
    x_[i] = -facets_[i].normal[0] * 3;  // on all facets but that one
    y_[i] = -facets_[i].normal[1] * 3;
    z_[i] = -facets_[i].normal[2] * 3;
    norm2_[i] = max_norm2_;
    for (std::uint8_t j = 0, slot = 0; j < 4; ++j)
      if (j != i) corners_[i][slot++] = j;
  }
}

bool DraftPolytope::Clip(std::uint32_t id, const double* normal, double offset) {
  const std::size_t removed = FindRemoved(normal, offset);
  if (removed == 0 || removed == vertex_count_ || gave_up_) return false;
  const Facets touched = FindCrossings(removed);
  if (facet_count_ == kMostFacets || vertex_count_ + crossing_count_ > kMostVertices || !IsCircle())
    return GiveUp();

  const auto made = static_cast<std::uint8_t>(facet_count_++);
  facets_[made] = {{normal[0], normal[1], normal[2]}, offset, id};
  Facets kept = 0;
  const std::size_t old_count = vertex_count_;
  for (std::size_t c = 0; c < crossing_count_; ++c) {
    const Crossing& crossing = crossings_[c];
    corners_[old_count + c] = {made, crossing.first, crossing.second};
    kept |= Bit(crossing.first) | Bit(crossing.second);
    Locate(old_count + c, crossing);
  }
  vertex_count_ += crossing_count_;
  for (std::size_t i = removed; i-- > 0;) {
    --vertex_count_;
    if (removed_[i] != vertex_count_) MoveVertex(vertex_count_, removed_[i]);
  }
  // A facet that lost vertices and has no crossed edge lost all.
  for (Facets dead = touched & ~kept; dead != 0;) {
    const auto last = static_cast<std::size_t>(std::bit_width(dead)) - 1;
    dead ^= Bit(last);
    DropFacet(last);
  }
  max_norm2_ = 0;
  for (std::size_t v = 0; v < vertex_count_; ++v) max_norm2_ = std::max(max_norm2_, norm2_[v]);
  return true;
}

// Writes the places of the vertices that the half-space cuts off, ascending, and returns their
// number.
std::size_t DraftPolytope::FindRemoved(const double* normal, double offset) {
  const double nx = normal[0], ny = normal[1], nz = normal[2];
  const std::size_t count = vertex_count_;
  for (std::size_t v = 0; v < count; ++v)
    excess_[v] = nx * x_[v] + ny * y_[v] + nz * z_[v] - offset;
  std::size_t removed = 0;
  for (std::size_t v = 0; v < count; ++v) {
    removed_[removed] = static_cast<std::uint8_t>(v);
    removed += excess_[v] > 0;
  }
  return removed;
}

// Finds the edges with one removed end, by that end and by slot. An edge is on two facets, and no
// two edges are on the same two. Returns the facets of the removed vertices.
DraftPolytope::Facets DraftPolytope::FindCrossings(std::size_t removed) {
  std::fill_n(across_, facet_count_, Facets{0});
  Facets touched = 0;
  for (std::size_t i = 0; i < removed; ++i) {
    const auto [a, b, c] = corners_[removed_[i]];
    const Facets all = Bit(a) | Bit(b) | Bit(c);
    touched |= all;
    across_[a] ^= all ^ Bit(a);  // twice, and gone, of an edge that is removed whole
    across_[b] ^= all ^ Bit(b);
    across_[c] ^= all ^ Bit(c);
  }
  std::size_t count = 0;
  const auto add = [&](std::uint8_t first, std::uint8_t second, std::uint8_t end) {
    crossings_[count] = {first, second, end};
    count += across_[first] >> second & 1;
  };
  for (std::size_t i = 0; i < removed; ++i) {
    const std::uint8_t v = removed_[i];
    const auto [a, b, c] = corners_[v];
    add(b, c, v);
    add(a, c, v);
    add(a, b, v);
  }
  crossing_count_ = count;
  return touched;
}

// Whether the crossed edges, two on each facet that has any, form one cycle.
bool DraftPolytope::IsCircle() const {
  const std::size_t first = crossings_[0].first;
  std::size_t from = first, at = crossings_[0].second;
  for (std::size_t steps = 1; steps <= crossing_count_; ++steps) {
    const Facets others = across_[at] ^ Bit(from);
    if (!std::has_single_bit(others)) return false;
    from = at;
    at = static_cast<std::size_t>(std::countr_zero(others));
    if (from == first) return steps == crossing_count_;
  }
  return false;
}

void DraftPolytope::Locate(std::size_t v, const Crossing& crossing) {
  const Facet *first = &facets_[corners_[v][0]], *second = &facets_[crossing.first],
              *third = &facets_[crossing.second];
  // By id, as Meet does.
  if (third->id < second->id) std::swap(second, third);
  if (second->id < first->id) std::swap(first, second);
  if (third->id < second->id) std::swap(second, third);
  double x[3];
  const bool solved = MeetThree(first, second, third, x);
  double norm2 = solved ? SquaredNorm<3>(x) : 0;
  // Mostly the removed end is the farther one, and the other need not be found.
  if (!solved || !(norm2 <= norm2_[crossing.removed] * (1 + kSlack))) {
    const std::size_t kept = KeptEnd(crossing), removed = crossing.removed;
    if (!solved || !(norm2 <= norm2_[kept] * (1 + kSlack))) {
      double from[3], to[3];
      CopyPlace(kept, from);
      CopyPlace(removed, to);
      norm2 = Interpolate<3>({from, norm2_[kept], excess_[kept]},
                             {to, norm2_[removed], excess_[removed]}, x);
    }
  }
  x_[v] = x[0];
  y_[v] = x[1];
  z_[v] = x[2];
  norm2_[v] = norm2;
}

// Returns the kept end of an edge: it is on both facets of the edge, as the other end is, and not
// cut off.
std::size_t DraftPolytope::KeptEnd(const Crossing& crossing) const {
  const Facets edge = Bit(crossing.first) | Bit(crossing.second);
  std::size_t v = 0;
  for (;; ++v) {
    const auto [a, b, c] = corners_[v];
    if ((edge & ~(Bit(a) | Bit(b) | Bit(c))) == 0 && !(excess_[v] > 0)) return v;
  }
}

void DraftPolytope::MoveVertex(std::size_t from, std::size_t to) {
  x_[to] = x_[from];
  y_[to] = y_[from];
  z_[to] = z_[from];
  norm2_[to] = norm2_[from];
  corners_[to] = corners_[from];
}

// The last facet takes the place of one that no vertex is left on.
void DraftPolytope::DropFacet(std::size_t f) {
  const std::size_t last = --facet_count_;
  if (f == last) return;
  facets_[f] = facets_[last];
  for (std::size_t v = 0; v < vertex_count_; ++v)
    for (std::uint8_t& g : corners_[v])
      if (g == last) g = static_cast<std::uint8_t>(f);
}

bool DraftPolytope::GiveUp() {
  gave_up_ = true;
  max_norm2_ = 0;
  return false;
}

// The two ends of an edge are on the same two facets: this is how adjacent vertices are found.
template <>
void RestrictedVoronoiCell<3>::Take(const DraftPolytope& polytope) {
  constexpr std::size_t kMost = DraftPolytope::kMostFacets;
  using Ends = std::array<std::array<std::uint16_t, kMost>, kMost>;
  thread_local const auto memory = std::make_unique<Ends>();  // see ThreadPolytope
  Ends& end = *memory;                                        // vertex and slot
  std::uint64_t mixed[kMost];
  std::uint64_t is_known[kMost] = {};  // by facet, the others whose edge's first end is known
  facets_.resize(polytope.facet_count());
  for (std::size_t f = 0; f < facets_.size(); ++f) {
    const DraftPolytope::Facet& from = polytope.facet(f);
    facets_[f] = {{from.normal[0], from.normal[1], from.normal[2]}, from.offset, from.id, 0};
    mixed[f] = Mix64(from.id);
  }
  vertices_.resize(polytope.vertex_count());
  keys_.resize(vertices_.size());
  for (std::size_t v = 0; v < vertices_.size(); ++v) {
    Vertex& vertex = vertices_[v];
    const auto [a, b, c] = polytope.corner(v);
    polytope.CopyPlace(v, vertex.x);
    vertex.norm2 = polytope.norm2(v);
    vertex.judged = false;
    keys_[v] = mixed[a] + mixed[b] + mixed[c];
    const std::uint8_t edges[3][2] = {{b, c}, {a, c}, {a, b}};
    for (std::size_t s = 0; s < 3; ++s) {
      const Index f = vertex.facet[s] = polytope.corner(v)[s];
      ++facets_[f].vertices;
      const auto [low, high] = std::minmax(edges[s][0], edges[s][1]);
      std::uint16_t& met = end[low][high];
      if (is_known[low] >> high & 1) {
        vertex.adjacent[s] = static_cast<Index>(met / 4);
        vertices_[met / 4].adjacent[met % 4] = static_cast<Index>(v);
      } else {
        is_known[low] |= std::uint64_t{1} << high;
        met = static_cast<std::uint16_t>(4 * v + s);
      }
    }
  }
  d_ = 0;
  centres_.clear();
  max_norm2_ = polytope.max_norm2();
  has_fake_ =
      std::any_of(facets_.begin(), facets_.end(), [](const Facet& f) { return IsFake(f.id); });
}

}  // namespace stellate::core
