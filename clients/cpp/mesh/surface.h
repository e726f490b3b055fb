#pragma once

#include <Eigen/Core>

#include "stellate/mesh.h"

namespace stellate::client {

// The points (3 x n) and simplices, turned to agree, that formats of triangles hold of a mesh: all
// of it, or of a solid its surface: the triangles that one tetrahedron alone has, turned outwards
// of it, into a cavity where they are around one. Points within are left out.
struct Drawn {
  Eigen::MatrixXd points;
  SimplexMatrix simplices;
};
Drawn DrawnOf(const Mesh& mesh);

// The simplices, and of the points (3 x n) those that they have, in their order.
Drawn WithTheirPoints(const Eigen::MatrixXd& points, SimplexMatrix simplices);

// The facets of one simplex alone, as it induces their orientation.
SimplexMatrix BoundaryOf(const SimplexMatrix& simplices);

}  // namespace stellate::client
