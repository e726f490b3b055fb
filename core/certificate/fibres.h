#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/certificate/certifier.h"
#include "core/certificate/topology.h"
#include "core/sample/ball_tree.h"
#include "core/specification.h"

namespace stellate::core {

// How a mesh meets the normal flats (fibres) of M. If each fibre meets it exactly once nearby, the
// mesh is M seen along its normals: nothing missing, nothing doubled, nothing bridged.
class Fibres {
 public:
  // `max_diameter`: of the mesh's simplices.
  Fibres(const MeshView& mesh, const Adjacency& adjacency, double max_diameter);

  // The mesh vertex nearest to x, and its distance.
  struct Nearest {
    std::uint32_t vertex = 0;
    double distance = 0;
  };
  Nearest NearestVertex(const double* x) const;

  // The number of points within reach_out of x where the flat x + T^perp meets the mesh; tangent
  // is d x k, orthonormal. When the flat passes so close to the boundary of a simplex that
  // rounding would decide, parallel ones, at most 0.02 reach_out to the side, are tried; -1 if
  // all of them do so too.
  int CountHits(const double* x, const double* tangent, double reach_out,
                std::uint64_t random_key);

 private:
  // A mesh vertex near x, its tangent coordinates relative to x.
  struct NearVertex {
    std::uint32_t id = 0;
    std::array<double, kMaxDimension> flat{};
  };

  void Gather(const double* x, const double* tangent);
  int CountHitsBeside(const double* x, const std::array<double, kMaxDimension>& shift) const;
  // Is the simplex's point with these barycentric coordinates within reach_out of x?
  bool IsWithinReach(const double* x, const std::uint32_t* ids, double first,
                     const std::array<double, kMaxDimension>& others) const;

  const MeshView& mesh_;
  const Adjacency& adjacency_;
  const double max_diameter_;
  double reach_out_ = 0;
  std::vector<double> coordinates_;
  BallTree tree_;
  std::vector<NearVertex> near_;
  std::vector<std::uint32_t> place_;  // by vertex: its place in near_, plus one; 0 if not there
};

}  // namespace stellate::core
