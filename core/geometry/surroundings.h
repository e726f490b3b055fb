#pragma once

#include <cstdint>

#include "core/geometry/facet_ids.h"

namespace stellate::core {

// What a cell of a point p must know of the sample while it is clipped. Implement it to give the
// cell its half-spaces and centres (StarSurroundings in core/complex).
template <int K>
class Surroundings {
 public:
  virtual ~Surroundings() = default;

  // Writes the normal of a facet's half-space and returns its offset, as Clip was given them.
  virtual double HalfSpace(std::uint32_t id, double* normal) const = 0;

  // Returns the dimension of the space in which vertices are judged. 0: at their place in T_pM; the
  // cell is the convex polytope of Lemma 2.4.2. d: at a centre in R^d that depends on the dual
  // simplex alone; the cell is then a polytope in its combinatorics only.
  virtual int judged_in() const = 0;
  // Writes the centre of the simplex on p and the K points `ids`, relative to p (d numbers), and
  // its tangent coordinates x. `key`: the sum of Mix64 over the ids. Returns false, and writes
  // nothing, if the vertex stays at its place in T_pM.
  virtual bool Centre(const std::uint32_t* ids, std::uint64_t key, double* x,
                      double* centre) const = 0;
  // Writes T_p x (d numbers).
  virtual void Lift(const double* x, double* centre) const = 0;
};

// Writes the normal of facet i of the regular simplex with this inradius with which a cell begins,
// and returns its offset. Facet i of K+1 has the id kFirstFakeId + i.
template <int K>
double FakeHalfSpace(int i, double inradius, double* normal);

}  // namespace stellate::core
