#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "stellate/error.h"
#include "stellate/mesh.h"

namespace stellate::client {

// A surface of its own, of points that its triangles have, as slicers and scenes hold a mesh.
struct Part {
  // The triangles of a wall.
  struct Patch {
    std::string name;  // "wall_0", ...; "" where there are no walls
    std::vector<Eigen::Index> columns;
  };
  std::string name;
  Eigen::MatrixXd points;   // 3 x n
  SimplexMatrix triangles;  // turned outwards where the part is closed
  std::vector<Patch> patches;
  bool is_closed = false;  // each edge is between two triangles
};

// Of a surface of space or a solid: a part for each region, or one in all. kFileFailed where there
// is no triangle; `ending`: of the file, for the error.
Expected<std::vector<Part>> PartsOf(const Mesh& mesh, const std::string& ending);

// kFileFailed where corners of a triangle fall together in single precision.
Expected<void> CheckSinglePrecision(const Eigen::MatrixXd& points, const SimplexMatrix& triangles,
                                    const std::string& format);

}  // namespace stellate::client
