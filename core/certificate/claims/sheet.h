#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/certificate/mesh_view.h"
#include "core/index/ball_tree.h"

namespace stellate::core {

// The mesh of a wall: some of the facets of the mesh of M. Use it to see how far a point is from
// the wall, as far as the mesh shows it:
//
//   Sheet sheet(mesh);
//   sheet.Add(ids, sides);                // each simplex
//   sheet.Index();
//   sheet.DistanceFrom(y);
struct Sheet {
  explicit Sheet(const MeshView& of) : mesh(of), tree(of.d, &barycentres) {}
  Sheet(Sheet&&) = delete;  // the tree borrows the barycentres

  // Adds the simplex of these k vertices; `outward` is the caller's to fill.
  void Add(const std::uint32_t* ids, std::pair<int, int> of);
  // Builds the tree. REQUIRES: what follows.
  void Index();

  bool is_empty() const { return radii.empty(); }
  const std::uint32_t* Ids(std::uint32_t f) const {
    return simplices.data() + f * static_cast<std::size_t>(mesh.k);
  }
  // Returns the squared distance from one of the simplices.
  double SquaredDistanceFrom(std::uint32_t f, const double* y) const;
  // Returns the distance from the nearest simplex; infinity if there is none.
  double DistanceFrom(const double* y) const;
  // Returns a simplex near y, mostly one of the nearest. REQUIRES: there is one.
  std::uint32_t SomeNear(const double* y) const;

  const MeshView& mesh;
  std::vector<std::uint32_t> simplices;    // k ids each
  std::vector<double> barycentres;         // d each
  std::vector<double> outward;             // d each: out of the mesh, within the tangent space of
                                           // the simplex that ends there
  std::vector<double> radii;               // around the barycentres
  std::vector<double> directions;          // k - 1 of d numbers each: orthonormal, along it
  std::vector<std::pair<int, int>> sides;  // as of FaceMesh
  double largest_radius = 0;
  BallTree tree;  // of the barycentres, by these radii

 private:
  double SquaredBoundFrom(std::uint32_t f, const double* y) const;
};

}  // namespace stellate::core
