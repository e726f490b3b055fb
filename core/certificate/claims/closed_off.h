#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/function_ref.h"
#include "core/certificate/complex/topology.h"
#include "core/certificate/mesh_view.h"

namespace stellate::core {

// A complex with boundary that was closed off by cones over its boundary to one additional vertex,
// the apex. It is a manifold with boundary if the closed one has spheres as links, except at the
// apex: the link of a boundary vertex is a ball exactly if it becomes a sphere when the cone over
// its boundary is added.
//
// An arrangement may be pinched: M, or a region of it, touches itself in an edge or a point alone,
// as two squares of a chessboard do. Such a vertex is taken for as many as there are parts at it.
struct ClosedOff {
  std::uint32_t apex = 0;          // the largest id
  std::vector<std::uint32_t> ids;  // k+1 ascending ids of each simplex, the cones last
  std::size_t cones_at = 0;        // where in `ids` the cones begin
  // The mesh's vertices that the ids from mesh.vertices to the apex stand for.
  std::vector<std::uint32_t> copied;
  // What the copies add to the Euler characteristic.
  std::int64_t euler_of_copies = 0;
  // The first vertex with another number of parts than its walls' signs leave, in plain words; or
  // empty.
  std::string wrong_parts;

  SimplexList list(int k) const { return {k, apex + 1, &ids}; }
  // Returns the mesh's vertex, or its number of vertices for the apex.
  std::uint32_t Original(std::uint32_t id) const;
  // Returns the boundary's simplices, k ids each, of this complex.
  std::vector<std::uint32_t> Boundary(int k) const;
  // Returns what to add to its Euler characteristic for that of the complex itself.
  std::int64_t EulerOfRest(int k) const;
};

// Closes off some simplices of a mesh with boundary.
//   is_end  whether a face of dimension k - 1 is in their boundary
//   label   of the region that they are; 0: they are all of M
ClosedOff CloseOff(const MeshView& mesh, const std::vector<std::uint32_t>& simplices, int label,
                   FunctionRef<bool(const FaceMesh&)> is_end);

// Returns the sectors of a region, or of all of M if `label` is 0, at a point on `walls`, given the
// signs of all others.
std::vector<WallSet> SectorsOf(const LabelTable& table, WallSet walls, WallSet signs, int label);
// The same at a vertex.
std::vector<WallSet> SectorsAt(const MeshView& mesh, std::uint32_t v, int label);
// Returns the part that each sector is in, as the place of one of them: sectors that share a wall
// are in one part.
std::vector<std::size_t> PartsOfSectors(const std::vector<WallSet>& sectors);

// Whether M ends at a face: there is a region on one side of it alone.
inline bool IsEnd(const FaceMesh& face) {
  return (face.sides.first == 0) != (face.sides.second == 0);
}

// Counts the components, and computes the Euler characteristic, of simplices of one dimension.
struct Shape {
  std::uint64_t components = 0;
  std::int64_t euler_characteristic = 0;
};
Shape ShapeOf(int dimension, const std::vector<std::uint32_t>& simplices);

}  // namespace stellate::core
