#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/certificate/certifier.h"
#include "core/certificate/topology.h"
#include "core/sample/ball_tree.h"

namespace stellate::core {

// How a mesh meets the normal flats (fibres) of M. If each fibre meets it exactly once nearby, the
// mesh is M seen along its normals: nothing missing, nothing doubled, nothing bridged.
class Fibres {
 public:
  // `reach_out`: how far along a fibre to look; `max_diameter`: of the mesh's simplices.
  Fibres(const MeshView& mesh, const Adjacency& adjacency, double reach_out, double max_diameter);

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
  int CountHits(const double* x, const double* tangent, std::uint64_t random_key) const;

 private:
  int CountHitsOnce(const double* x, const double* tangent,
                    const std::vector<std::uint32_t>& nearby) const;

  const MeshView& mesh_;
  const Adjacency& adjacency_;
  const double reach_out_;
  const double search_radius_;
  std::vector<double> coordinates_;
  BallTree tree_;
};

}  // namespace stellate::core
