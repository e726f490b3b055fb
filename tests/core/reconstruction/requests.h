#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>

#include "core/reconstruction.h"
#include "tests/reconstruction/samples.h"

namespace stellate::core {

inline ReconstructionSpecification SpecOf(int k, int d) {
  ReconstructionSpecification spec;
  spec.dimension = k;
  spec.ambient_dimension = d;
  return spec;
}

inline testing::SampleRequest Of(const char* manifold, std::uint32_t points, bool even,
                                 double noise = 0) {
  testing::SampleRequest request;
  request.manifold = manifold;
  request.points = points;
  request.even = even;
  request.noise = noise;
  return request;
}

inline std::uint32_t SizeOf(const Eigen::MatrixXd& points) {
  return static_cast<std::uint32_t>(points.cols());
}

// Points of a place.
inline std::uint64_t Places(const Reconstruction& r, Place place) {
  return r.report.reconstruction->places[static_cast<std::size_t>(place)];
}

}  // namespace stellate::core
