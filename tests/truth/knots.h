#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace stellate::truth {

// The closed polygons, 3 x n each, that the edges of a closed curve mesh make; empty if they make
// none.
std::vector<Eigen::MatrixXd> Polygons(const Eigen::MatrixXd& points,
                                      const std::vector<std::uint32_t>& edges);

// What tells closed polygons of R^3 apart whatever their shape: the determinant of each (that of
// the unknot is 1, of the trefoil 3), and the linking numbers of all pairs; each list ascending.
struct KnotType {
  std::vector<std::uint64_t> determinants;
  std::vector<int> linking;

  bool operator==(const KnotType&) const = default;
};
KnotType KnotTypeOf(const std::vector<Eigen::MatrixXd>& polygons);

}  // namespace stellate::truth
