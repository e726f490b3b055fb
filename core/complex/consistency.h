#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/instantiate.h"
#include "core/complex/stars.h"

namespace stellate::core {

// A simplex is consistent if it is in the star of each of its vertices (Sec. 3.2). If all are, the
// stars glue to a manifold.

// Returns a hash that distinguishes simplices: the sum of Mix64 over the ids of the simplex dual to
// vertex v of p's cell. Two simplices have the same key once in 2^64 pairs; the certificate does
// not use keys.
template <int K>
std::uint64_t SimplexKey(const RestrictedVoronoiCell<K>& cell, std::size_t v, std::uint32_t p) {
  return cell.key(v) + Mix64(p);
}

// Returns the vertex of `cell`, the cell of q, that is dual to a simplex on q with that key, or
// nothing.
template <int K>
std::optional<std::size_t> FindSimplex(const RestrictedVoronoiCell<K>& cell, std::uint32_t q,
                                       const typename Stars<K>::Simplex& simplex,
                                       std::uint64_t key);

// Whether the simplex dual to vertex v of p's cell is in the stars of all its vertices. A simplex
// of a face must not be foreign either. Of arrangements, it must have the same labels on all its
// sides in all these stars.
template <int K>
bool IsConsistent(const Stars<K>& stars, std::uint32_t p, std::size_t v, int sector = 0);

// Whether star(q) has a simplex of that key and that piece (Sample::Piece).
template <int K>
bool HasSimplex(const Stars<K>& stars, std::uint32_t q, std::uint64_t key, std::uint64_t piece);

// Finds consistent simplices of all stars, with one search per simplex instead of one for each of
// its stars. It does not find all: ask IsConsistent about the others, and about those at the
// boundary.
template <int K>
class ConsistentSimplices {
 public:
  // In parallel.
  explicit ConsistentSimplices(const Stars<K>& stars);

  // Returns the vertices of p's cell that are known to be dual to consistent simplices: a bit each,
  // of the first 64.
  std::uint64_t Of(std::uint32_t p) const { return known_[p].load(std::memory_order_relaxed); }

 private:
  void Note(std::uint32_t p, std::size_t v) {
    if (v < 64) known_[p].fetch_or(std::uint64_t{1} << v, std::memory_order_relaxed);
  }

  std::vector<std::atomic<std::uint64_t>> known_;
};

// Finds the simplices of star(p) that overlap a neighbour in it near their common facet, seen in
// T_pM. Only stars that are judged at common centres can be folded.
template <int K>
class Folds {
 public:
  Folds(const Stars<K>& stars, std::uint32_t p, int sector = 0);

  // Whether the simplex dual to vertex v of p's cell is folded over a neighbour.
  bool IsFolded(std::size_t v) const { return folded_[v] != 0; }

 private:
  std::vector<std::uint8_t> folded_;  // by vertex
};

// Counts the simplices of star(p) that are missing from the star of one of their vertices.
template <int K>
std::uint64_t CountInconsistent(const Stars<K>& stars, std::uint32_t p);

// sigma is in star(p) but not in star(q), although q is a vertex of it. On the way from c_p(sigma)
// to c_q(sigma), in the flat of points equidistant from sigma's vertices, `nearer` is the first
// sample point that becomes nearer than these vertices. sigma and `nearer` are the (k+1)-simplex of
// Sec. 3.2.
template <int K>
struct InconsistentConfiguration {
  typename Stars<K>::Simplex simplex;
  std::uint32_t holder = 0;             // p
  std::uint32_t refuser = 0;            // q
  std::optional<std::uint32_t> nearer;  // none if rounding or a common centre decided
};

// Returns the first inconsistent configuration of star(p), by vertex and then by id, if it has one.
template <int K>
std::optional<InconsistentConfiguration<K>> FindInconsistentConfiguration(const Stars<K>& stars,
                                                                          std::uint32_t p);

STELLATE_DECLARE_CLASS(ConsistentSimplices)
STELLATE_DECLARE_CLASS(Folds)

}  // namespace stellate::core
