#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stellate/error.h"
#include "stellate/oracle.h"
#include "stellate/report.h"

namespace stellate {

using SimplexMatrix = Eigen::Matrix<std::uint32_t, Eigen::Dynamic, Eigen::Dynamic>;

// The part of a mesh that lies on some walls.
struct Face {
  Walls walls;
  SimplexMatrix simplices;  // (j+1) x m for a face of dimension j, in order as a mesh's
};

// How a mesh is oriented: simplex s is turned, its last two ids exchanged, where bit s % 8 of
// turned[s / 8] is set.
struct Orientation {
  bool orientable = false;  // else nothing is turned
  std::vector<std::uint8_t> turned;
};

// The labels that the normal of a simplex, by the order of its ids, points away from and into; 0 is
// outside, and a solid without labels has the label 1. If the manifold does not fill space (k < d):
// those on the positive and the negative side of the simplex's wall.
struct Sides {
  std::uint8_t behind = 0, ahead = 0;

  bool operator==(const Sides&) const = default;
};

// A simplicial k-complex in R^d. Of a surface in space, for instance:
//
//   for (const auto& ids : stellate::OrientedSimplices(mesh).colwise())
//     Draw(mesh.points.col(ids[0]), mesh.points.col(ids[1]), mesh.points.col(ids[2]));
//   const stellate::Expected<void> saved = mesh.Save("surface.vtu");
struct Mesh {
  Eigen::MatrixXd points;   // d x n, a vertex a column
  SimplexMatrix simplices;  // (k+1) x m; ascending ids in each column, columns in ascending order
  Report report;
  // Of a manifold with boundary, n: the walls that each point lies on, wall i as bit i; else empty.
  std::vector<std::uint64_t> walls = {};
  // As the server says of a mesh that is over, for `simplices` as they are; else none. Clear it
  // when you change them.
  std::optional<Orientation> orientation = {};
  // Of an arrangement of walls, m: the region that each simplex is in; else empty.
  std::vector<std::uint8_t> labels = {};
  // Of the boundary alone (MeshOptions::boundary_only), m: the labels on both sides of each
  // simplex; else empty.
  std::vector<Sides> sides = {};
  // The names of the regions with the labels 1, 2, ..., as the oracle gave them; "": none.
  std::vector<std::string> region_names = {};

  // Whether this is a boundary without its inside.
  bool is_boundary() const { return !sides.empty(); }

  // The part with one label, of the same points. Its boundary is where it ends or meets others. Of
  // the boundary alone: the closed surface of that region, its normals outwards. Throws
  // std::invalid_argument where no simplex has the label.
  Mesh Region(int label) const;

  // The faces of a manifold with boundary, by ascending walls: the boundary's parts, one for each
  // wall, of dimension k - 1; curves where two walls meet or more; points where k walls meet; and
  // those of any dimension below k. What lies between two regions is among all but the boundary.
  // The boundary alone has faces of its own dimension, too, which are its parts.
  std::vector<Face> boundary() const;
  std::vector<Face> edges() const;
  std::vector<Face> corners() const;
  std::vector<Face> faces(int dimension) const;

  int dimension() const { return static_cast<int>(simplices.rows()) - 1; }
  int ambient_dimension() const { return static_cast<int>(points.rows()); }

  // Writes the format that the path's ending names:
  //   .txt  any k and d: "k d nv ns", then nv lines of d coordinates (%.17g), then ns lines of k+1
  //         ids from zero, in the order of `simplices`
  //   .off  curves and surfaces; nOFF with all coordinates unless d = 3
  //   .obj  curves and surfaces, d <= 3, text
  //   .ply  curves and surfaces, d <= 3, binary, in double precision
  //   .stl  surfaces of space, binary, in single precision as the format has it
  //   .3mf  surfaces of space, for 3D printers, in millimetres: an object for each region
  //   .glb  surfaces of space, for Blender and browsers: a node for each region, smooth normals and
  //         a material for each wall, in single precision, z upwards
  //   Of a solid (k = d = 3) these six hold the surface, outwards, around a cavity into that.
  //   .msh  k <= 3, d <= 3: Gmsh's, version 2.2, text
  //   .vtu  k <= 3; beyond d = 3 the first three coordinates, and all as point data "coordinates";
  //         field data "epsilon", "certified" (0 or 1), "verdict" and "version" (UTF-8 bytes)
  //   .npz  any k and d, exact, for numpy.load: arrays "points" (n, d), "simplices" (m, k+1), and
  //         where there are some "walls" (n,), "labels" (m,), "region_names"; of the boundary alone
  //         "labels" (m, 2), its sides; of a mesh that is over "certified", "verdict", "epsilon"
  //   .nas, .bdf, .fem  k, d <= 3: Nastran bulk data, text, without faces; regions are properties
  // Of a mesh with boundary .msh, .vtu and .obj have its faces too, of all dimensions, after its
  // simplices: in .msh as physical groups "inside", or where there are several regions by the
  // region's name, "region_1" for label 1 if it has none, "wall_0", ..., "walls_0_1", ...; in .obj
  // as groups of the same names; in .vtu with cell data "walls", the walls as bits (0 inside), and
  // "group", .msh's number of it, field data "groups", their names, a line each, and point data
  // "walls". With labels .vtu has cell data "region", a simplex's label, 0 of faces, and "sides",
  // of the faces of dimension k - 1 the labels that they face away from and face (0, 0 of others).
  // Faces between regions are among them, turned outwards from the lower label. All
  // but .txt and .npz are oriented as by OrientedSimplices(mesh). The file is replaced when the new
  // one is whole. kFileFailed when the format cannot hold the mesh or the file cannot be written.
  Expected<void> Save(const std::string& path) const;
};

// What Save would refuse, asked before there is a mesh: kFileFailed for a path whose format holds
// no mesh of these dimensions, or whose folder is not there or cannot be written to.
Expected<void> CheckSave(const std::string& path, int dimension, int ambient_dimension);

// The simplices with the ids in each reordered so that neighbours agree on their orientation; as
// they are when the complex is not an orientable pseudomanifold.
SimplexMatrix OrientedSimplices(const SimplexMatrix& simplices);
// The same, and the normals of a hypersurface (k = d - 1) outwards, component by component;
// simplices that fill space (k = d) with positive volumes; the boundary alone from the larger of
// its two labels into the smaller one. By mesh.orientation, where it is known; meshes that grow, or
// that no server made, are oriented here.
SimplexMatrix OrientedSimplices(const Mesh& mesh);

}  // namespace stellate
