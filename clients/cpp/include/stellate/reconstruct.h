#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "stellate/connection.h"
#include "stellate/error.h"
#include "stellate/mesh.h"

namespace stellate {

// How stars of points that disagree are made to agree.
enum class Weighting {
  kAsNeeded,  // by tilings, and by weights of points where these do not do
  kOnly,      // by weights of points alone: the mesh is the weighted tangential Delaunay complex
};

// What points are, and how they are to become a mesh.
struct ReconstructOptions {
  int dimension = 0;  // k of the manifold, 1 to 3; required
  // The standard deviation of each coordinate from the manifold, a length; 0: points are on it.
  // Absent: as the points show.
  std::optional<double> noise;
  // A promise: the manifold's reach is at least this length. A mesh of exact points may then be
  // proved.
  std::optional<double> reach;
  double drop = 0.001;  // the share of the points that may be left out
  bool closed = true;   // false: it may have a boundary, and the mesh ends where the points end
  Weighting weights = Weighting::kAsNeeded;
  // Whether vertices may be added, after the points, where stars disagree and nothing else helps:
  // at most one for each hundred points, or 16.
  bool steiner = false;
  // Where axes have different units: about how far the manifold goes along each, d lengths above
  // zero, or one for all. The complex is built in x / scale: noise, reach and the report's lengths,
  // angles and places are there. Points, tangents and the mesh are in x.
  std::vector<double> scale = {};

  Connection connection;  // without a server: a private one, as of MeshOptions
  std::function<void(const Progress&)> on_progress;  // called on the calling thread
  std::stop_token stop;                              // cancels: kStopped
  std::string label;                                 // shown in the server's lists and logs
};

// Makes a mesh of points on a manifold, or near it, d x n. They are its vertices, by their columns,
// and its first ones; Report::reconstruction says what became of them. `tangents`, (d k) x n, where
// they are known: of each point k orthonormal vectors, entry i*k + a being coordinate i of vector
// a.
//
//   const auto mesh = stellate::Reconstruct(points, {.dimension = 2});
//
// Returns a mesh whenever the run ends by itself, certified or not. kRefused: a point or an option
// is wrong, and is named.
Expected<Mesh> Reconstruct(const Eigen::MatrixXd& points, const ReconstructOptions& options,
                           const Eigen::MatrixXd& tangents = {});

}  // namespace stellate
