#pragma once

#include <cstdint>

#include "core/reconstruction.h"

namespace stellate::server {

// What a client declared of the points that it is going to send.
struct PointsRequest {
  core::ReconstructionSpecification spec;
  std::uint64_t points = 0;   // n
  bool has_tangents = false;  // they come with the points
};

// Bytes that a point has on the wire, in the journal, and in memory: itself, and its tangent basis.
inline std::uint64_t BytesOfPoint(const PointsRequest& request) {
  const int vectors = 1 + (request.has_tangents ? request.spec.dimension : 0);
  return sizeof(double) * static_cast<std::uint64_t>(request.spec.ambient_dimension) *
         static_cast<std::uint64_t>(vectors);
}

}  // namespace stellate::server
