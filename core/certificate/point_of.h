#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/certificate/mesh_view.h"

namespace stellate::core {

using ConstPoint = Eigen::Map<const Eigen::VectorXd>;

inline ConstPoint PointOf(const MeshView& mesh, std::uint32_t v) { return {mesh.Point(v), mesh.d}; }

}  // namespace stellate::core
