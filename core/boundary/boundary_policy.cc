#include "core/boundary/boundary_policy.h"

namespace stellate::core {

BoundaryPolicy::BoundaryPolicy(const Specification& spec)
    : BoundaryPolicy(spec.dimension, spec.walls, spec.boundary_only,
                     spec.walls > 0 && spec.dimension == spec.ambient_dimension) {}

std::vector<WallSet> BoundaryPolicy::FacesOfSeeds(std::size_t seeds) const {
  std::vector<WallSet> faces;
  if (walls_ == 0) return faces;
  faces.assign(seeds, 0);
  for (int wall = 0; wall < walls_; ++wall) faces.insert(faces.end(), seeds, SetOfWall(wall));
  return faces;
}

}  // namespace stellate::core
