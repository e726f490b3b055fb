#include "core/complex/cavities.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <set>

#include "core/base/instantiate.h"
#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"
#include "core/complex/cavity_census.h"
#include "core/complex/labels.h"
#include "core/geometry/simplex.h"

namespace stellate::core {
namespace {

// In cavities with at most this many vertices, simplices that no star holds are tried as well: 462
// for k = 4.
constexpr std::size_t kAllSubsets = 11;
// Larger cavities are left alone.
constexpr std::size_t kMostVertices = 48;
// Simplices placed, in one cavity, before the search is given up.
constexpr int kMostSteps = 4000;

// A determinant below this share of the product of its rows' lengths belongs to points that are off
// a wall by an oracle's error.
constexpr double kFlat = 1e-8;

template <int N>
double Determinant(double (&m)[N][N]) {
  double det = 1;
  for (int c = 0; c < N; ++c) {
    int pivot = c;
    for (int r = c + 1; r < N; ++r)
      if (std::abs(m[r][c]) > std::abs(m[pivot][c])) pivot = r;
    if (m[pivot][c] == 0) return 0;
    if (pivot != c) {
      std::swap(m[pivot], m[c]);
      det = -det;
    }
    det *= m[c][c];
    for (int r = c + 1; r < N; ++r) {
      const double factor = m[r][c] / m[c][c];
      for (int j = c + 1; j < N; ++j) m[r][j] -= factor * m[c][j];
    }
  }
  return det;
}

inline int Sign(double x) { return (x > 0) - (x < 0); }

template <int K>
class Cavity {
 public:
  using Simplex = typename Stars<K>::Simplex;
  using Facet = typename Census<K>::Facet;

  Cavity(const Census<K>& census, const FillingRules& rules, std::vector<Simplex> doubtful)
      : census_(census), stars_(census.stars), rules_(rules), doubtful_(std::move(doubtful)) {
    for (const Simplex& s : doubtful_) vertices_.insert(vertices_.end(), s.begin(), s.end());
    std::sort(vertices_.begin(), vertices_.end());
    vertices_.erase(std::unique(vertices_.begin(), vertices_.end()), vertices_.end());
  }

  const std::vector<std::uint32_t>& vertices() const { return vertices_; }
  const std::vector<Simplex>& filling() const { return filling_; }

  bool Fill() {
    if (vertices_.size() > kMostVertices || !FindSectors() || !Orient() || !FindBoundary())
      return false;
    for (const Simplex& s : doubtful_) Propose(s);
    if (Search()) return true;
    if (vertices_.size() > kAllSubsets) return false;
    candidates_.clear();
    by_facet_.assign(by_facet_.size(), {});
    Simplex s;
    ProposeAll(0, 0, s);
    return Search();
  }

 private:
  enum State : std::int8_t { kMinus = -1, kFree = 0, kPlus = 1, kClosed = 2 };
  struct Candidate {
    Simplex simplex;
    std::array<int, K + 1> facet;
    std::array<std::int8_t, K + 1> side;
    int holders;
    double fatness;
  };

  std::size_t Place(std::uint32_t v) const {
    return static_cast<std::size_t>(std::lower_bound(vertices_.begin(), vertices_.end(), v) -
                                    vertices_.begin());
  }

  static Facet Without(const Simplex& s, int i) {
    Facet facet;
    std::copy(s.begin(), s.begin() + i, facet.begin());
    std::copy(s.begin() + i + 1, s.end(), facet.begin() + i);
    return facet;
  }

  // Each vertex's sector in the region.
  bool FindSectors() {
    for (const std::uint32_t p : vertices_) {
      const std::optional<int> sector = census_.SectorOf(p);
      if (!sector) return false;
      sectors_.push_back(*sector);
    }
    return true;
  }

  // How each vertex's tangent basis is oriented relative to that of the vertex nearest to all.
  bool Orient() {
    const int d = stars_.sample().d();
    std::uint32_t middle = vertices_.front();
    double least = INFINITY;
    for (const std::uint32_t p : vertices_) {
      double farthest = 0;
      for (const std::uint32_t q : vertices_)
        farthest = std::max(farthest,
                            SquaredDistance(stars_.sample().Point(p), stars_.sample().Point(q), d));
      if (farthest < least) {
        least = farthest;
        middle = p;
      }
    }
    for (const std::uint32_t p : vertices_) {
      double m[K][K];
      for (int a = 0; a < K; ++a)
        for (int b = 0; b < K; ++b)
          m[a][b] =
              Dot(stars_.sample().Tangent(middle) + a * d, stars_.sample().Tangent(p) + b * d, d);
      orientation_.push_back(Sign(Determinant<K>(m)));
      if (orientation_.back() == 0) return false;
    }
    return true;
  }

  // The sign of a simplex, its vertices ascending, in p's tangent space; 0 if it is
  // degenerate there, as those are whose vertices are all on one flat wall.
  int SignAt(std::uint32_t p, const Simplex& s) const {
    const int d = stars_.sample().d();
    double m[K][K], lengths2 = 1;
    for (int i = 0; i < K; ++i) {
      const double* const at = stars_.sample().Point(s[static_cast<std::size_t>(i) + 1]);
      for (int a = 0; a < K; ++a) {
        const double* const t = stars_.sample().Tangent(p) + a * d;
        m[i][a] = 0;
        for (int j = 0; j < d; ++j) m[i][a] += t[j] * (at[j] - stars_.sample().Point(s[0])[j]);
      }
      lengths2 *= Dot(m[i], m[i], K);
    }
    const double determinant = Determinant<K>(m);
    if (determinant * determinant <= kFlat * kFlat * lengths2) return 0;
    return Sign(determinant) * orientation_[Place(p)];
  }

  // The orientation of a simplex seen from some vertices of the cavity, or 0 if they differ.
  template <typename Vertices>
  int OrientationOf(const Simplex& s, const Vertices& from) const {
    const int first = SignAt(from[0], s);
    for (const std::uint32_t p : from)
      if (SignAt(p, s) != first) return 0;
    return first;
  }

  // Returns the state of a facet of a doubtful simplex before the cavity is filled; nothing if it
  // is unknown.
  std::optional<State> StateOf(const Facet& facet) const {
    Simplex agreed[2];
    const int count = census_.AgreedOn(facet, agreed);
    const std::optional<int> wall = count < 2 ? census_.WallUnder(facet) : std::nullopt;
    if (count + wall.has_value() == 2) return kClosed;
    if (count + wall.has_value() == 0) return kFree;
    const int taken = wall ? SideBeyond(*wall, facet) : SideOf(agreed[0], facet);
    if (taken == 0) return std::nullopt;
    return static_cast<State>(-taken);
  }

  // The facets of doubtful simplices that an agreed one is on, from its other side.
  bool FindBoundary() {
    for (const Simplex& s : doubtful_) {
      for (int i = 0; i <= K; ++i) {
        const Facet facet = Without(s, i);
        if (!facets_.emplace(facet, static_cast<int>(state_.size())).second) continue;
        const std::optional<State> state = StateOf(facet);
        if (!state) return false;
        state_.push_back(*state);
        by_facet_.emplace_back();
      }
    }
    loose_.assign(vertices_.size(), 1);
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      const auto& cell = stars_.cell(vertices_[i], sectors_[i]);
      Simplex s;
      for (std::size_t v = 0; v < cell.vertex_count(); ++v)
        if (stars_.SimplexOf(vertices_[i], cell, v, &s) && !census_.IsDoubtful(s)) {
          loose_[i] = 0;
          break;
        }
    }
    return true;
  }

  // Returns the side of a facet on which an agreed simplex lies, seen from the facet's vertices:
  // its apex may not be a vertex of the cavity.
  int SideOf(const Simplex& s, const Facet& facet) const {
    std::size_t apex = 0;
    while (apex < K && s[apex] == facet[apex]) ++apex;
    const int orientation = OrientationOf(s, facet);
    return apex % 2 == 0 ? orientation : -orientation;
  }

  // Returns the empty side of a facet in a wall: where a simplex would lie whose first vertex is
  // beyond the wall.
  int SideBeyond(int wall, const Facet& facet) const {
    int side = 0;
    for (const std::uint32_t p : facet) {
      const double* const outward =
          stars_.sample().Conormals(p) +
          K * CountWalls(stars_.sample().walls(p) & (SetOfWall(wall) - 1));
      const Site site = stars_.sample().At(p, sectors_[Place(p)]);
      const double sign = IsSubset(SetOfWall(wall), site.reversed) ? -1 : 1;
      double m[K][K];
      for (int i = 0; i < K; ++i) {
        stars_.sample().Project(p, stars_.sample().Point(facet[static_cast<std::size_t>(i)]), m[i]);
        for (int a = 0; a < K; ++a) m[i][a] -= sign * outward[a];
      }
      const int here = Sign(Determinant<K>(m)) * orientation_[Place(p)];
      if (here == 0 || (side != 0 && here != side)) return 0;
      side = here;
    }
    return side;
  }

  void ProposeAll(std::size_t next, int chosen, Simplex& s) {
    if (chosen == K + 1) return Propose(s);
    for (std::size_t i = next; i < vertices_.size(); ++i) {
      s[static_cast<std::size_t>(chosen)] = vertices_[i];
      ProposeAll(i + 1, chosen + 1, s);
    }
  }

  void Propose(const Simplex& s) {
    const double* corners[K + 1];
    for (std::size_t i = 0; i <= K; ++i) corners[i] = stars_.sample().Point(s[i]);
    const SimplexVertices span(corners, K + 1);
    const SimplexMeasures measures = MeasureSimplex(span, stars_.sample().d());
    if (!(measures.circumradius <= rules_.epsilon) ||
        !(measures.RadiusEdgeRatio() <= rules_.radius_edge_bound))
      return;
    if (rules_.sliver_bound > 0 && ContainsSliver(span, stars_.sample().d(), rules_.sliver_bound))
      return;
    const int orientation = OrientationOf(s, s);
    if (orientation == 0 || !IsInRegion(s)) return;
    Candidate c{s, {}, {}, census_.Holders(s), measures.Fatness()};
    for (int i = 0; i <= K; ++i) {
      const Facet facet = Without(s, i);
      const auto [at, fresh] = facets_.emplace(facet, static_cast<int>(state_.size()));
      if (fresh) {
        // A facet of agreed simplices that is not on this cavity's boundary is none of its own.
        Simplex agreed[2];
        state_.push_back(census_.AgreedOn(facet, agreed) > 0 ? kClosed : kFree);
        by_facet_.emplace_back();
      }
      const auto slot = static_cast<std::size_t>(i);
      c.facet[slot] = at->second;
      c.side[slot] = static_cast<std::int8_t>(i % 2 == 0 ? orientation : -orientation);
      if (!Fits(c, slot)) return;
    }
    for (const int f : c.facet)
      by_facet_[static_cast<std::size_t>(f)].push_back(static_cast<int>(candidates_.size()));
    candidates_.push_back(c);
  }

  // A simplex on walls alone may be taken for one of the region beyond.
  bool IsInRegion(const Simplex& s) const {
    const Sectors& sectors = stars_.sample().sectors();
    return sectors.labels().empty() ||
           LabelOf(stars_, s.data()) == sectors.Label(s[0], sectors_[Place(s[0])]);
  }

  bool Fits(const Candidate& c, std::size_t slot) const {
    const State state = state_[static_cast<std::size_t>(c.facet[slot])];
    return state == kFree || state == c.side[slot];
  }
  bool Fits(const Candidate& c) const {
    for (std::size_t i = 0; i <= K; ++i)
      if (!Fits(c, i)) return false;
    return true;
  }

  bool Search() {
    for (auto& list : by_facet_)
      std::sort(list.begin(), list.end(), [&](int a, int b) {
        const Candidate& x = candidates_[static_cast<std::size_t>(a)];
        const Candidate& y = candidates_[static_cast<std::size_t>(b)];
        if (x.holders != y.holders) return x.holders > y.holders;
        return x.fatness != y.fatness ? x.fatness > y.fatness : x.simplex < y.simplex;
      });
    steps_ = 0;
    placed_.clear();
    return Extend();
  }

  // Closes the open facet with the fewest choices, and all after it.
  bool Extend() {
    int chosen = -1;
    std::size_t fewest = candidates_.size() + 1;
    for (std::size_t f = 0; f < state_.size() && fewest > 0; ++f) {
      if (state_[f] != kPlus && state_[f] != kMinus) continue;
      std::size_t choices = 0;
      for (const int c : by_facet_[f]) choices += Fits(candidates_[static_cast<std::size_t>(c)]);
      if (choices >= fewest) continue;
      fewest = choices;
      chosen = static_cast<int>(f);
    }
    if (chosen < 0) return Complete();
    if (fewest == 0) return false;
    const std::vector<int>& choices = by_facet_[static_cast<std::size_t>(chosen)];
    for (const int c : choices) {
      const Candidate& candidate = candidates_[static_cast<std::size_t>(c)];
      if (!Fits(candidate)) continue;
      if (++steps_ > kMostSteps) return false;
      std::array<State, K + 1> before;
      for (std::size_t i = 0; i <= K; ++i) {
        State& state = state_[static_cast<std::size_t>(candidate.facet[i])];
        before[i] = state;
        state = state == kFree ? static_cast<State>(-candidate.side[i]) : kClosed;
      }
      placed_.push_back(c);
      if (Extend()) return true;
      placed_.pop_back();
      for (std::size_t i = 0; i <= K; ++i)
        state_[static_cast<std::size_t>(candidate.facet[i])] = before[i];
    }
    return false;
  }

  // No vertex may be left without a simplex.
  bool Complete() {
    std::vector<std::uint8_t> left = loose_;
    for (const int c : placed_)
      for (const std::uint32_t v : candidates_[static_cast<std::size_t>(c)].simplex)
        left[Place(v)] = 0;
    if (std::find(left.begin(), left.end(), 1) != left.end()) return false;
    filling_.clear();
    for (const int c : placed_)
      filling_.push_back(candidates_[static_cast<std::size_t>(c)].simplex);
    return true;
  }

  const Census<K>& census_;
  const Stars<K>& stars_;
  const FillingRules& rules_;
  std::vector<Simplex> doubtful_;
  std::vector<std::uint32_t> vertices_;  // ascending
  std::vector<int> sectors_;             // by vertex
  std::vector<int> orientation_;         // by vertex
  std::vector<std::uint8_t> loose_;      // by vertex: in no agreed simplex
  std::map<Facet, int> facets_;
  std::vector<State> state_;                // by facet: the side that is still to be covered
  std::vector<std::vector<int>> by_facet_;  // candidates
  std::vector<Candidate> candidates_;
  std::vector<int> placed_;
  std::vector<Simplex> filling_;
  int steps_ = 0;
};

// The regions of an arrangement that have points, ascending; without labels there is one.
template <int K>
std::vector<std::uint64_t> RegionsOf(const Stars<K>& stars) {
  const Sectors& sectors = stars.sample().sectors();
  std::set<std::uint64_t> regions;
  for (std::uint32_t p = 0; p < stars.size(); ++p)
    for (int sector = 0; sector < sectors.Count(p); ++sector)
      regions.insert(sectors.Piece(p, sector, 0));
  regions.erase(0);  // no region
  return {regions.begin(), regions.end()};
}

// Adds what FillCavities finds in a region.
template <int K>
void FillRegion(const Stars<K>& stars, const FillingRules& rules, std::uint64_t region,
                FilledCavities* result, std::vector<typename Stars<K>::Simplex>* all) {
  const Census<K> census(stars, region);
  std::vector<Cavity<K>> cavities;
  for (auto& part : PartDoubtful<K>(census)) cavities.emplace_back(census, rules, std::move(part));
  std::vector<std::uint8_t> filled(cavities.size());
  ParallelFor(cavities.size(), [&](std::size_t i) { filled[i] = cavities[i].Fill(); });
  result->inconsistent += census.doubtful.size();
  result->cavities += cavities.size();
  all->insert(all->end(), census.agreed.begin(), census.agreed.end());
  for (std::size_t i = 0; i < cavities.size(); ++i) {
    const Cavity<K>& cavity = cavities[i];
    if (filled[i]) {
      ++result->filled;
      result->filling += cavity.filling().size();
      all->insert(all->end(), cavity.filling().begin(), cavity.filling().end());
    }
    auto& ids = filled[i] ? result->tiled : result->unfilled;
    ids.insert(ids.end(), cavity.vertices().begin(), cavity.vertices().end());
  }
}

}  // namespace

template <int K>
FilledCavities FillCavities(const Stars<K>& stars, const FillingRules& rules) {
  FilledCavities result;
  std::vector<typename Stars<K>::Simplex> all;
  for (const std::uint64_t region : RegionsOf(stars))
    FillRegion(stars, rules, region, &result, &all);
  for (auto* ids : {&result.tiled, &result.unfilled}) {
    std::sort(ids->begin(), ids->end());
    ids->erase(std::unique(ids->begin(), ids->end()), ids->end());
  }
  ParallelSort(all, std::less<>());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  result.simplices.reserve(all.size() * (K + 1));
  for (const auto& s : all) result.simplices.insert(result.simplices.end(), s.begin(), s.end());
  return result;
}

#define STELLATE_EACH(K) \
  template FilledCavities FillCavities<K>(const Stars<K>&, const FillingRules&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
