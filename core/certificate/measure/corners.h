#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/certificate/mesh_view.h"
#include "core/geometry/simplex.h"
#include "core/specification.h"

namespace stellate::core {

// The corners of a mesh's simplices as simplex.h wants them, one simplex after the other.
class Corners {
 public:
  // Valid until the next call. k: the mesh's, a constant where that is faster.
  [[gnu::always_inline]] SimplexVertices Of(const MeshView& mesh, const std::uint32_t* ids, int k) {
    for (int i = 0; i <= k; ++i) at_[i] = mesh.Point(ids[i]);
    return {at_.data(), static_cast<std::size_t>(k) + 1};
  }

 private:
  std::array<const double*, kMaxDimension + 1> at_{};
};

}  // namespace stellate::core
