#pragma once

#include <cstdint>

namespace stellate::core {

// Ids of the facets that bound a cell before its neighbours are known.
inline constexpr std::uint32_t kFirstFakeId = 0xfffffff0u;
inline constexpr bool IsFake(std::uint32_t id) { return id >= kFirstFakeId; }

// What the cell of p asks whoever knows the sample.
template <int K>
class Surroundings {
 public:
  virtual ~Surroundings() = default;

  // The half-space of a facet, as Clip was given it.
  virtual double HalfSpace(std::uint32_t id, double* normal) const = 0;

  // Where the vertices are judged. 0: at their place in T_pM; the cell is the convex polytope of
  // Lemma 2.4.2. d: at a centre in R^d that depends on the dual simplex alone; the cell is then a
  // polytope in its combinatorics only.
  virtual int judged_in() const = 0;
  // Writes the centre of the simplex on p and the K points `ids`, relative to p (d numbers), and
  // its tangent coordinates x. `key`: the sum of Mix64 over the ids. False, and nothing written,
  // where the vertex stays at its place in T_pM.
  virtual bool Centre(const std::uint32_t* ids, std::uint64_t key, double* x,
                      double* centre) const = 0;
  // Writes T_p x (d numbers).
  virtual void Lift(const double* x, double* centre) const = 0;
};

// The facets that a cell begins with: those of a regular simplex with this inradius. Facet i of
// K+1 has the id kFirstFakeId + i. Writes the normal, returns the offset.
template <int K>
double FakeHalfSpace(int i, double inradius, double* normal);

}  // namespace stellate::core
