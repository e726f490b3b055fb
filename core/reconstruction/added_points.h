#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/index/ball_tree.h"
#include "core/reconstruction/fitted_cloud.h"

namespace stellate::core {

// Points that are added to a cloud after its own (Steiner points).

// Returns the position among these points, the middle of some of them or of two, that is farthest
// from all points of the cloud, d coordinates; nothing if none is as far as a tenth of the spacing.
std::optional<std::vector<double>> FindEmptiest(const FittedCloud& cloud,
                                                std::span<const std::uint32_t> around);

// Adds a point at the end of the cloud: at the place of the quadric through its neighbours that is
// over `position`, with their tangent space there. `tree`: of the cloud's points, except those
// added, which are not among the neighbours.
void AddPoint(const BallTree& tree, const std::vector<double>& position, FittedCloud* cloud);

// Removes a point that was added.
void RemovePoint(std::uint32_t p, FittedCloud* cloud);

}  // namespace stellate::core
