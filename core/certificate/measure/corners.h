#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/certificate/mesh_view.h"
#include "core/geometry/simplex.h"
#include "core/specification.h"

namespace stellate::core {

// Gives the corners of a mesh's simplices in the form of simplex.h, one simplex after the other.
class Corners {
 public:
  // The result is valid until the next call. k: the mesh's, a constant if that is faster.
  [[gnu::always_inline]] SimplexVertices Of(const MeshView& mesh, const std::uint32_t* ids, int k) {
    for (int i = 0; i <= k; ++i) at_[i] = mesh.Point(ids[i]);
    return {at_.data(), static_cast<std::size_t>(k) + 1};
  }

 private:
  std::array<const double*, kMaxDimension + 1> at_{};
};

}  // namespace stellate::core
