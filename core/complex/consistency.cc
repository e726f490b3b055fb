#include "core/complex/consistency.h"

#include <Eigen/Core>
#include <algorithm>

#include "core/base/dense.h"
#include "core/base/instantiate.h"
#include "core/base/parallel.h"

namespace stellate::core {
namespace {

// c_q(sigma): the point of T_qM equidistant from sigma's vertices, in ambient coordinates.
template <int K>
Eigen::VectorXd CentreIn(const Stars<K>& stars, std::uint32_t q,
                         const typename Stars<K>::Simplex& simplex) {
  Eigen::Matrix<double, K, K> rows;
  Eigen::Matrix<double, K, 1> rhs;
  int r = 0;
  for (const std::uint32_t v : simplex) {
    if (v == q) continue;
    double normal[K];
    rhs[r] = 0.5 * stars.sample().Project(q, stars.sample().Point(v), normal);
    for (int a = 0; a < K; ++a) rows(r, a) = normal[a];
    ++r;
  }
  const Eigen::Matrix<double, K, 1> x = SolvePivoted(rows, rhs);
  Eigen::VectorXd centre(stars.sample().d());
  stars.sample().Lift(q, x.data(), centre.data());
  return centre;
}

// The sign of the simplex on p and the K points of the facets at vertex v of its cell, seen in
// T_pM.
template <int K>
double Orientation(const Stars<K>& stars, std::uint32_t p, std::size_t v, int sector) {
  const auto& cell = stars.cell(p, sector);
  if constexpr (K == 3) {  // by far the most often
    const double* const a = cell.normal(cell.facet(v, 0));
    const double* const b = cell.normal(cell.facet(v, 1));
    const double* const c = cell.normal(cell.facet(v, 2));
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
           a[2] * (b[0] * c[1] - b[1] * c[0]);
  }
  double m[K][K];
  for (int r = 0; r < K; ++r) stars.HalfSpace(p, cell.facet(v, r), m[r], sector);
  double sign = 1;
  for (int c = 0; c < K; ++c) {
    int pivot = c;
    for (int r = c + 1; r < K; ++r)
      if (std::abs(m[r][c]) > std::abs(m[pivot][c])) pivot = r;
    if (m[pivot][c] == 0) return 0;
    if (pivot != c) {
      std::swap(m[pivot], m[c]);
      sign = -sign;
    }
    if (m[c][c] < 0) sign = -sign;
    for (int r = c + 1; r < K; ++r) {
      const double factor = m[r][c] / m[c][c];
      for (int j = c + 1; j < K; ++j) m[r][j] -= factor * m[c][j];
    }
  }
  return sign;
}

// The order of the facets of a vertex w compared with those of its neighbour v, where w's facet off
// v takes the place of v's facet off w.
struct Turned {
  std::size_t off_v;  // that facet
  bool odd;           // an odd permutation
};

// `s`: the slot of v's facet that is off w.
template <int K>
Turned TurnOf(const RestrictedVoronoiCell<K>& cell, std::size_t v, int s, std::size_t w) {
  if constexpr (K == 3) {
    const int other = s == 0 ? 1 : 0;
    const auto first = cell.facet(v, other), second = cell.facet(v, 3 - s - other);
    int t = 0;
    while (t < 2 && (cell.facet(w, t) == first || cell.facet(w, t) == second)) ++t;
    const bool swapped = cell.facet(w, t == 0 ? 1 : 0) != first;
    return {cell.facet(w, t), ((s + t) % 2 != 0) != swapped};
  }
  int at[K];  // the place among v's facets of each of w's
  Turned turned{0, false};
  for (int r = 0; r < K; ++r) {
    at[r] = s;
    for (int i = 0; i < K; ++i)
      if (cell.facet(v, i) == cell.facet(w, r)) at[r] = i;
    if (at[r] == s) turned.off_v = cell.facet(w, r);
  }
  for (int r = 0; r < K; ++r)
    for (int i = 0; i < r; ++i) turned.odd = turned.odd != (at[i] > at[r]);
  return turned;
}

}  // namespace

template <int K>
std::optional<std::size_t> FindSimplex(const RestrictedVoronoiCell<K>& cell, std::uint32_t q,
                                       const typename Stars<K>::Simplex& simplex,
                                       std::uint64_t key) {
  if constexpr (K == 2) {  // no key is quicker than the ids themselves
    const auto has = [&](std::uint32_t id) {
      return std::find(simplex.begin(), simplex.end(), id) != simplex.end();
    };
    if (!has(q)) return std::nullopt;
    for (std::size_t v = 0; v < cell.vertex_count(); ++v)
      if (has(cell.id(cell.facet(v, 0))) && has(cell.id(cell.facet(v, 1)))) return v;
  } else if (const std::size_t v = cell.Find(key - Mix64(q)); v < cell.vertex_count()) {
    return v;
  }
  return std::nullopt;
}

template <int K>
bool HasSimplex(const Stars<K>& stars, std::uint32_t q, std::uint64_t key, std::uint64_t piece) {
  for (int sector = 0; sector < stars.sample().sectors().Count(q); ++sector) {
    const auto& cell = stars.cell(q, sector);
    const std::size_t v = cell.Find(key - Mix64(q));
    if (v < cell.vertex_count() &&
        stars.sample().sectors().Piece(q, sector, WallsAt<K>(cell, v)) == piece)
      return true;
  }
  return false;
}

namespace {

// IsConsistent for a star at the boundary, where the simplex may be one of a face.
template <int K>
bool IsConsistentOnFaces(const Stars<K>& stars, std::uint32_t p, std::size_t v, int sector) {
  const auto& cell = stars.cell(p, sector);
  const auto simplex = stars.FaceSimplexOf(p, cell, v);
  if (simplex.fake || simplex.foreign) return false;
  const std::uint64_t key = SimplexKey<K>(cell, v, p);
  const std::uint64_t piece = stars.sample().sectors().Piece(p, sector, simplex.walls);
  for (int i = 0; i < simplex.count; ++i) {
    const std::uint32_t q = simplex.ids[static_cast<std::size_t>(i)];
    if (q != p && !HasSimplex<K>(stars, q, key, piece)) return false;
  }
  return true;
}

// Returns the vertex of the cell of q that is dual to a simplex on q with these other vertices and
// that key; vertex_count() if there is none.
template <int K>
std::size_t FindIn(const RestrictedVoronoiCell<K>& cell, std::uint32_t q, std::uint64_t key,
                   const std::uint32_t (&others)[K]) {
  if constexpr (K == 2) {  // no key is quicker than the ids themselves
    std::size_t v = 0;
    for (; v < cell.vertex_count(); ++v) {
      const std::uint32_t a = cell.id(v), b = cell.id(cell.Next(v));
      if ((a == others[0] && b == others[1]) || (a == others[1] && b == others[0])) break;
    }
    return v;
  } else {
    return cell.Find(key - Mix64(q));
  }
}

// Searches the stars of its other vertices for the simplex dual to vertex v of p's cell, and writes
// its place in each, by facet of v. Returns false if it is not in all of them.
template <int K>
bool FindInStars(const Stars<K>& stars, std::uint32_t p, std::size_t v, std::uint32_t (&others)[K],
                 std::size_t (&at)[K]) {
  const auto& cell = stars.cell(p);
  for (int s = 0; s < K; ++s) {
    others[s] = cell.id(cell.facet(v, s));
    if (!IsSample(others[s])) return false;
  }
  const std::uint64_t key = K == 2 ? 0 : SimplexKey<K>(cell, v, p);
  for (int s = 0; s < K; ++s) {
    std::uint32_t rest[K];
    std::copy_n(others, K, rest);
    rest[s] = p;
    const auto& there = stars.cell(others[s]);
    at[s] = FindIn<K>(there, others[s], key, rest);
    if (at[s] == there.vertex_count()) return false;
  }
  return true;
}

}  // namespace

template <int K>
bool IsConsistent(const Stars<K>& stars, std::uint32_t p, std::size_t v, int sector) {
  if (stars.sample().walls(p) != 0 || !stars.sample().sectors().labels().empty())
    return IsConsistentOnFaces<K>(stars, p, v, sector);
  std::uint32_t others[K];
  std::size_t at[K];
  return FindInStars<K>(stars, p, v, others, at);
}

template <int K>
ConsistentSimplices<K>::ConsistentSimplices(const Stars<K>& stars) : known_(stars.size()) {
  if (!stars.sample().sectors().labels().empty()) return;  // the stars' labels count, too
  ParallelFor(stars.size(), [&](std::uint32_t p) {
    if (stars.sample().walls(p) != 0) return;
    const auto& cell = stars.cell(p);
    std::uint32_t others[K];
    std::size_t at[K];
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      bool lowest = true;
      for (int s = 0; s < K; ++s) lowest = lowest && cell.id(cell.facet(v, s)) > p;
      if (!lowest || !FindInStars<K>(stars, p, v, others, at)) continue;
      Note(p, v);
      for (int s = 0; s < K; ++s) Note(others[s], at[s]);
    }
  });
}

// Neighbours lie on different sides of their common facet if their signs differ, with the one's
// vertex off it in the place of the other's.
template <int K>
Folds<K>::Folds(const Stars<K>& stars, std::uint32_t p, int sector)
    : folded_(stars.cell(p, sector).vertex_count()) {
  const auto& cell = stars.cell(p, sector);
  thread_local std::vector<double> sides;
  sides.resize(folded_.size());
  for (std::size_t v = 0; v < sides.size(); ++v) {
    sides[v] = Orientation<K>(stars, p, v, sector);
    folded_[v] = sides[v] == 0;
  }
  const auto is_wall = [&](std::size_t facet) { return IsWall(cell.id(facet)); };
  for (std::size_t v = 0; v < sides.size(); ++v) {
    for (int s = 0; s < K; ++s) {
      const std::size_t w = cell.adjacent(v, s);
      if (w < v) continue;
      const auto [off_v, odd] = TurnOf<K>(cell, v, s, w);
      const double product = sides[w] * sides[v];
      if (!(odd ? product <= 0 : product >= 0)) continue;
      // Beyond a wall there is nothing to fold over.
      if (!is_wall(off_v)) folded_[v] = 1;
      if (!is_wall(cell.facet(v, s))) folded_[w] = 1;
    }
  }
}

template <int K>
std::uint64_t CountInconsistent(const Stars<K>& stars, std::uint32_t p) {
  std::uint64_t count = 0;
  for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector) {
    const auto& cell = stars.cell(p, sector);
    for (std::size_t v = 0; v < cell.vertex_count(); ++v)
      count += stars.sample().sectors().Piece(p, sector, WallsAt<K>(cell, v)) != 0 &&
               !IsConsistent<K>(stars, p, v, sector);
  }
  return count;
}

namespace {

// FindInconsistentConfiguration in one of the star's sectors.
template <int K>
std::optional<InconsistentConfiguration<K>> FindInconsistentIn(const Stars<K>& stars,
                                                               std::uint32_t p, int sector) {
  InconsistentConfiguration<K> found;
  found.holder = p;
  const auto& cell = stars.cell(p, sector);
  const std::uint64_t piece = stars.sample().sectors().Piece(p, sector, 0);
  if (piece == 0) return std::nullopt;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    if (!stars.SimplexOf(p, cell, v, &found.simplex)) continue;
    const std::uint64_t key = SimplexKey<K>(cell, v, p);
    for (const std::uint32_t q : found.simplex) {
      if (q == p || HasSimplex<K>(stars, q, key, piece)) continue;
      found.refuser = q;
      const Eigen::VectorXd from = CentreIn<K>(stars, p, found.simplex);
      const Eigen::VectorXd to = CentreIn<K>(stars, q, found.simplex);
      // |z - l|^2 - |z - q|^2 is linear in z: where it turns negative, l becomes nearer.
      double first = 2;
      const int d = stars.sample().d();
      const double radius = Distance(to.data(), stars.sample().Point(q), d);
      stars.sample().ForEachWithin(to.data(), radius, [&](std::uint32_t l) {
        const double* at = stars.sample().Point(l);
        const double start = SquaredDistance(from.data(), at, d) -
                             SquaredDistance(from.data(), stars.sample().Point(q), d);
        const double end = SquaredDistance(to.data(), at, d) - radius * radius;
        if (std::find(found.simplex.begin(), found.simplex.end(), l) != found.simplex.end() ||
            !(end < 0))
          return;
        const double when = start <= 0 ? 0 : start / (start - end);
        if (when < first || (when == first && l < *found.nearer)) {
          first = when;
          found.nearer = l;
        }
      });
      return found;
    }
  }
  return std::nullopt;
}

}  // namespace

template <int K>
std::optional<InconsistentConfiguration<K>> FindInconsistentConfiguration(const Stars<K>& stars,
                                                                          std::uint32_t p) {
  for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector)
    if (auto found = FindInconsistentIn<K>(stars, p, sector)) return found;
  return std::nullopt;
}

#define STELLATE_EACH(K)                                                                        \
  template std::optional<std::size_t> FindSimplex<K>(                                           \
      const RestrictedVoronoiCell<K>&, std::uint32_t, const Stars<K>::Simplex&, std::uint64_t); \
  template bool IsConsistent(const Stars<K>&, std::uint32_t, std::size_t, int);                 \
  template bool HasSimplex(const Stars<K>&, std::uint32_t, std::uint64_t, std::uint64_t);       \
  template std::uint64_t CountInconsistent(const Stars<K>&, std::uint32_t);                     \
  template std::optional<InconsistentConfiguration<K>> FindInconsistentConfiguration(           \
      const Stars<K>&, std::uint32_t);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH
STELLATE_INSTANTIATE_CLASS(ConsistentSimplices)
STELLATE_INSTANTIATE_CLASS(Folds)

}  // namespace stellate::core
