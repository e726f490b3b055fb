#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "core/certificate/clear_points.h"
#include "core/label_table.h"
#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {

// A finished mesh as the certifier sees it: the complex and the sample, without how they came
// about. The arrays are borrowed, and must outlive the Certifier.
//
//   MeshView mesh{2, 3, 4, points.data(), tangents.data(), &triangles};  // four points of space
struct MeshView {
  int k = 0, d = 0;
  std::uint64_t vertices = 0;
  const double* points = nullptr;    // vertices x d, C order
  const double* tangents = nullptr;  // vertices x k x d, C order, orthonormal rows
  const std::vector<std::uint32_t>* simplices = nullptr;  // k+1 ascending vertex ids each

  // By vertex, 1: it is left out on purpose, and is in no simplex; null: none is.
  const std::uint8_t* unused = nullptr;

  // For manifolds with boundary, else null: the walls of each vertex; the sum of their conormals, k
  // tangent coordinates for each vertex; and the faces.
  const WallSet* walls = nullptr;
  const double* outward = nullptr;
  const std::vector<FaceMesh>* faces = nullptr;
  // For arrangements of walls, else null: the label of each simplex and of each sign vector; the
  // walls' signs at each vertex; and whether it is on one side alone of all its walls.
  const std::int8_t* labels = nullptr;
  const LabelTable* table = nullptr;
  const WallSet* signs = nullptr;
  const std::uint8_t* one_sided = nullptr;
  // The signs of the sectors of vertices where more walls meet than k independent ones. Of all
  // other vertices the walls and the table tell them.
  const std::map<std::uint32_t, std::vector<WallSet>>* corner_sectors = nullptr;
  // The squared radii of protecting balls, by vertex (Sample::SetProtectingBalls); null: none.
  const double* protecting_radii2 = nullptr;

  bool IsUnused(std::uint32_t v) const { return unused && unused[v] != 0; }
  WallSet WallsOf(std::uint32_t v) const { return walls ? walls[v] : 0; }
  double ProtectingRadius2(std::uint32_t v) const {
    return protecting_radii2 ? protecting_radii2[v] : 0;
  }
  // Whether Outward points out of M: at a vertex with M on both sides of a wall it does not.
  bool HasOutside(std::uint32_t v) const {
    return WallsOf(v) != 0 && (!one_sided || one_sided[v] != 0);
  }
  const double* Outward(std::uint32_t v) const { return outward + std::size_t{v} * k; }
  const double* Point(std::uint32_t v) const { return points + std::size_t{v} * d; }
  const double* Tangent(std::uint32_t v) const { return tangents + std::size_t{v} * d * k; }
};

// Points of M, d each, and the walls that each is on.
struct PointsOnWalls {
  std::vector<double> points;
  std::vector<WallSet> walls;
};

// Facts that only the stars give. The defaults say nothing for the mesh: without `converged` no
// certificate is given.
struct StarFacts {
  std::uint64_t inconsistent_simplices = 0;
  double max_circumradius = 0;        // max R_p(sigma)
  bool converged = false;             // no rule is broken
  double max_size_ratio = 0;          // max R_p / size(p) where the size is graded, else 0
  std::vector<double> lone_points{};  // each all of M around it, d coordinates: no mesh shows them
  PointsOnWalls touches{};            // corners, each all of these walls around it
  double same_point = 0;              // points nearer to each other than this are one, length
  bool covers_box = false;  // every component of M in the bounding box is met, if the declared
                            // reach is true
  double tangent_error_length = 0;  // sin(tangent_error) times the reach (TangentFinder), length
  double protection = 0;            // R5's bound, length; 0: it was not asked for
  CentreRule centre_rule = CentreRule::kTangentSpace;  // where stars judge simplices
};

// Points of M that lie on one wall each: the point (d), the wall, and the wall's outward conormal
// within M there (d).
struct EndsOfManifold {
  std::vector<double> points;
  std::vector<int> walls;
  std::vector<double> conormals;
  std::vector<std::pair<int, int>> sides;  // as of FaceMesh

  void Add(const double* y, int wall, const double* conormal, int d,
           std::pair<int, int> of = {0, 1}) {
    points.insert(points.end(), y, y + d);
    walls.push_back(wall);
    sides.push_back(of);
    conormals.insert(conormals.end(), conormal, conormal + d);
  }
};

// What a run learned of M while it made the mesh.
struct KnownOfManifold {
  std::vector<double> points;              // of M, d each, that are no vertices
  std::vector<double> tangential_offsets;  // answers y to q and the parts of q - y along M, 2 d
                                           // each (UndeclaredBoundaryCheck): M may end there
  EndsOfManifold ends;                     // points on walls that are no vertices
  ClearPoints clear;                       // all answers with clearances, vertices too
};

}  // namespace stellate::core
