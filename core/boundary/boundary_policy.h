#pragma once

#include <cstddef>
#include <vector>

#include "core/batch.h"
#include "core/specification.h"
#include "core/walls.h"

namespace stellate::core {

// What the walls of a manifold change in how it is meshed. A run, its engine and its samplers ask
// here instead of looking for walls themselves; None() is the policy of a manifold without
// boundary. (The face on which one point or simplex lies is its own WallSet.)
//
//   const BoundaryPolicy policy(spec);
//   for (int stage = policy.first_stage(); stage <= policy.last_stage(); ++stage)  // mesh faces
class BoundaryPolicy {
 public:
  // Of a k-manifold without boundary.
  static BoundaryPolicy None(int k) { return {k, 0, false, false}; }
  // Whatever the specification declares, None included.
  explicit BoundaryPolicy(const Specification& spec);

  int walls() const { return walls_; }
  // Faces are meshed in stages, by dimension, the lowest first. Without walls there is one stage,
  // that of M itself, k; of the boundary alone the last one is that of dimension k - 1.
  int first_stage() const { return MeshesFacesFirst() ? 0 : k_; }
  int last_stage() const { return leaves_inside_ ? k_ - 1 : k_; }
  // Whether faces are meshed before the inside. Seeds are queried on them, and wait for the stage
  // of their face; stars have no simplices of the inside until then.
  bool MeshesFacesFirst() const { return walls_ > 0; }
  // Whether the inside is never meshed, and the mesh handed out is the boundary's.
  bool LeavesInside() const { return leaves_inside_; }
  // Whether walls force sharp dihedral angles upon tetrahedra.
  bool SharpensDihedrals() const { return k_ == 3 && walls_ > 0; }

  // The faces on which each of `seeds` points is queried, a run of all seeds for each face: M, then
  // each wall. Empty: on M alone.
  std::vector<WallSet> FacesOfSeeds(std::size_t seeds) const;
  // How many times that asks of each seed.
  int QueriesOfSeed() const { return walls_ + 1; }
  // Has a block ask for what walls need, clearances.
  void AddWishes(QueryBlock* block) const { block->want.clearances = TakesClearances(); }
  // Whether answers tell on which side of walls their points are, and vertices which walls they are
  // on.
  bool TakesClearances() const { return walls_ > 0; }
  // Whether a candidate may go to and fro between its flat and M. Such steps would leave a face.
  bool MayAlternate() const { return walls_ == 0; }
  // Whether a point is its own closest point where no wall is near: M fills space between walls.
  bool FillsSpace() const { return fills_space_; }
  // Whether the end of M, if it has one, was not declared.
  bool MayEndUndeclared() const { return walls_ == 0; }

 private:
  BoundaryPolicy(int k, int walls, bool leaves_inside, bool fills_space)
      : k_(k), walls_(walls), leaves_inside_(leaves_inside), fills_space_(fills_space) {}

  int k_, walls_;
  bool leaves_inside_, fills_space_;
};

}  // namespace stellate::core
