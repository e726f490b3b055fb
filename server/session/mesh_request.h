#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/specification.h"
#include "server/oracles/dispatch.h"
#include "server/points/points_request.h"
#include "server/spans/trace_context.h"

namespace stellate::server {

// All that a client declared of a mesh, as a journal keeps it.
struct MeshRequest {
  std::string name;                       // "meshes/<id>"
  std::string owner;                      // empty where clients are not authenticated
  std::string label;                      // the client's
  std::string about;                      // what its oracle says of itself, printable
  std::vector<std::string> region_names;  // of labels 1, 2, ..., printable; an empty one is none
  // Of axes of different units, d: what is delivered is x = y * scale of what is meshed; or empty.
  Eigen::VectorXd scale;
  core::Specification spec;
  OracleTimeouts timeouts;
  TraceHeaders trace;  // of the call that made it
  // Set: the mesh is made of points, not of answers. `spec` then has its dimensions alone.
  std::optional<PointsRequest> points;
};

// The certificate's verdict as people read it: what the oracle says of itself is its last sentence,
// marked as the oracle's own words. Stays empty.
std::string VerdictOf(const MeshRequest& request, const std::string& verdict);

}  // namespace stellate::server
