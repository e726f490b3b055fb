#include "core/geometry/corner_cone.h"

#include <Eigen/Core>
#include <algorithm>

#include "core/base/dense.h"
#include "core/base/instantiate.h"
#include "core/base/interruption.h"

namespace stellate::core {
namespace {

// A direction within this sine of a wall is along it. Conormals are as precise as the walls'
// gradients; walls that cross at less than 14 degrees are refused anyway.
constexpr double kAlongFace = 1e-6;

// Returns the next set of the same number of walls, in the order of the sets as numbers.
WallSet NextOfSize(WallSet set) {
  const WallSet lowest = set & (~set + 1), ripple = set + lowest;
  return ripple | ((set ^ ripple) >> 2) / lowest;
}

}  // namespace

template <int K>
CornerCone<K> ConeOf(WallSet walls, const double* conormals) {
  using Vector = Eigen::Matrix<double, K, 1>;
  const int count = CountWalls(walls);
  const Eigen::Map<const Eigen::Matrix<double, K, Eigen::Dynamic>> normals(conormals, K, count);
  std::vector<int> number;
  ForEachWall(walls, [&](int wall) { number.push_back(wall); });
  CornerCone<K> cone;
  // Returns the line common to K - 1 walls, in the direction that the others leave, if any.
  [[maybe_unused]] const auto try_along = [&](Vector along) {
    const Vector inward = -along;
    for (const Vector& u : {along, inward}) {
      if ((normals.transpose() * u).maxCoeff() > kAlongFace) continue;
      WallSet on = 0;
      for (int i = 0; i < count; ++i)
        if (normals.col(i).dot(u) >= -kAlongFace)
          on |= SetOfWall(number[static_cast<std::size_t>(i)]);
      const bool is_known = std::any_of(cone.rays.begin(), cone.rays.end(),
                                        [&](const auto& ray) { return ray.walls == on; });
      if (!is_known) cone.rays.push_back({u, on});
    }
  };
  if constexpr (K > 1) {
    std::size_t step = 0;
    for (WallSet set = SetOfWall(K - 1) - 1; set < SetOfWall(count); set = NextOfSize(set)) {
      CheckInterruption(step++);
      Eigen::MatrixXd rows(K - 1, K);
      int row = 0;
      ForEachWall(set, [&](int i) { rows.row(row++) = normals.col(i).transpose(); });
      if (const auto along = DirectionOffRows(rows, kAlongFace)) try_along(*along);
    }
  }
  Vector middle = Vector::Zero();
  for (const auto& ray : cone.rays) {
    middle += ray.along;
    cone.walls |= ray.walls;
    if (CountWalls(ray.walls) > K - 1) cone.crowded |= ray.walls;
  }
  cone.has_interior = !cone.rays.empty() && (normals.transpose() * middle).maxCoeff() < -kAlongFace;
  cone.is_simple = cone.has_interior && cone.crowded == 0;
  return cone;
}

#define STELLATE_EACH(K) template CornerCone<K> ConeOf<K>(WallSet, const double*);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
