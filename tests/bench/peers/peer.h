#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/peers/meter.h"

namespace stellate::bench {

// What a mesher is asked to do.
struct Task {
  std::string manifold;            // of the catalogue
  int ambient_dimension = 0;       // pad the manifold with zeros up to here; 0: its own dimension
  double size = 0;                 // the mesher's own parameter of size; see each mesher
  double time_limit = 0;           // seconds of the clock, for meshers that may never end; 0: none
  double radius_edge_bound = 0;    // Stellate's rho0; 0: its default
  bool estimate_tangents = false;  // GUDHI's complex: from neighbours, instead of being given them
  std::optional<double> clip;  // of a sphere what is beyond this along PoleOf it; see each mesher
};

// What it made of it, in the harness's terms.
struct Outcome {
  Eigen::MatrixXd points;                // d x n
  std::vector<std::uint32_t> simplices;  // k+1 vertex numbers each
  std::uint64_t evaluations = 0;         // how often the manifold was asked
  double oracle_seconds = 0;             // of the metered time, where it can be told apart
  double certificate_seconds = 0;        // likewise, oracle included
  std::string note;                      // what the mesher says of its own result
};

// Prepares, starts the meter, meshes, stops the meter, and only then converts. One thread. Throws
// std::exception when the manifold is none of its, or when it fails.
using Mesh = Outcome (*)(const Task& task, Meter& meter);

// Stellate's core, in this process. size: epsilon. Clips.
Outcome MeshWithStellate(const Task& task, Meter& meter);
// CGAL's make_surface_mesh, facet angles of at least 30 degrees. size: the bound on the radius of
// the facets' surface Delaunay balls.
Outcome MeshWithCgalSurface(const Task& task, Meter& meter);
// GUDHI's Tangential_complex with its repair of inconsistencies. size: the number of points of the
// sample that it is given, met to some per cent.
Outcome MeshWithGudhiTangential(const Task& task, Meter& meter);
// GUDHI's Manifold_tracing through a Coxeter triangulation, and the cells of it. size: the factor
// of the triangulation. Clips, by a domain function.
Outcome MeshWithGudhiCoxeter(const Task& task, Meter& meter);

}  // namespace stellate::bench
