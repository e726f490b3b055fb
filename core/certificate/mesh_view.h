#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/certificate/clear_points.h"
#include "core/report.h"

namespace stellate::core {

// A finished mesh as the certifier sees it: the complex and the sample, nothing of how they came
// about. Borrowed; must outlive the Certifier.
struct MeshView {
  int k = 0, d = 0;
  std::uint64_t vertices = 0;
  const double* points = nullptr;    // vertices x d, C order
  const double* tangents = nullptr;  // vertices x k x d, C order, orthonormal rows
  const std::vector<std::uint32_t>* simplices = nullptr;  // k+1 ascending vertex ids each

  // Of manifolds with boundary, else null: by vertex, its walls, and the sum of their conormals (k
  // tangent coordinates each); and the faces.
  const WallSet* walls = nullptr;
  const double* outward = nullptr;
  const std::vector<FaceMesh>* faces = nullptr;
  const double* protecting_radii2 =
      nullptr;  // by vertex, squared radii (Sample::SetProtectingBalls); null: none

  WallSet WallsOf(std::uint32_t v) const { return walls ? walls[v] : 0; }
  double ProtectingRadius2(std::uint32_t v) const {
    return protecting_radii2 ? protecting_radii2[v] : 0;
  }
  const double* Outward(std::uint32_t v) const { return outward + std::size_t{v} * k; }
  const double* Point(std::uint32_t v) const { return points + std::size_t{v} * d; }
  const double* Tangent(std::uint32_t v) const { return tangents + std::size_t{v} * d * k; }
};

// What only the stars know.
struct StarFacts {
  std::uint64_t inconsistent_simplices = 0;
  double max_circumradius = 0;  // max R_p(sigma)
  bool converged = false;       // no rule applies any more
  double max_size_ratio = 0;    // max R_p / size(p) where the size is graded, else 0
  bool covers_box = false;      // every component of M in the bounding box is met, if the declared
                                // reach is true
  double tangent_error_length = 0;  // sin(tangent_error) times the reach (TangentFinder), length
};

// Points of M, d each, and the walls that each is on.
struct PointsOnWalls {
  std::vector<double> points;
  std::vector<WallSet> walls;
};

// Points of M on one wall each, that wall, and its outward conormal within M there: d each.
struct EndsOfManifold {
  std::vector<double> points;
  std::vector<int> walls;
  std::vector<double> conormals;

  void Add(const double* y, int wall, const double* conormal, int d) {
    points.insert(points.end(), y, y + d);
    walls.push_back(wall);
    conormals.insert(conormals.end(), conormal, conormal + d);
  }
};

// What was learned of M before, while the mesh was made.
struct KnownOfManifold {
  std::vector<double> points;              // of M, d each, that are no vertices
  std::vector<double> tangential_offsets;  // where M may end: points y of M and the parts of q - y
                                           // along it (UndeclaredBoundaryCheck), 2 d each
  EndsOfManifold ends;  // that are no vertices
  ClearPoints clear;    // whatever was answered, vertices too
};

}  // namespace stellate::core
