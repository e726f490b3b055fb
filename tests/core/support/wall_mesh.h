#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

#include "tests/core/support/domain.h"
#include "tests/core/support/homology.h"

namespace stellate::testing {

// A mesh of a domain, as it came in deltas.
struct WallMesh {
  core::Report report;
  Complex simplices;
  std::vector<core::WallSet> walls;  // by vertex
  std::vector<Eigen::VectorXd> points;
  Complex Rim() const { return RimOf(simplices); }
};

inline WallMesh MeshOf(Domain m, core::Specification spec) {
  auto mesher = core::Mesher::Create(std::move(spec));
  if (!mesher) throw std::runtime_error(mesher.error().message);
  WallMesh mesh;
  const auto width = static_cast<std::size_t>(m.k) + 1;
  const auto each = [&](const std::vector<std::uint32_t>& all, const auto& take) {
    for (std::size_t s = 0; s < all.size(); s += width)
      take(std::vector<std::uint32_t>(all.begin() + static_cast<std::ptrdiff_t>(s),
                                      all.begin() + static_cast<std::ptrdiff_t>(s + width)));
  };
  while (const auto batch = (*mesher)->NextBatch()) {
    const auto delta = (*mesher)->Absorb(m.AnswersOf(*batch));
    if (!delta) throw std::runtime_error(delta.error().message);
    each(delta->removed, [&](const auto& s) { mesh.simplices.erase(s); });
    each(delta->added, [&](const auto& s) { mesh.simplices.insert(s); });
    mesh.walls.insert(mesh.walls.end(), delta->walls.begin(), delta->walls.end());
    for (Eigen::Index v = 0; v < delta->points.cols(); ++v)
      mesh.points.push_back(delta->points.col(v));
  }
  mesh.report = (*mesher)->report();
  return mesh;
}

// Each facet of the rim is on a wall, and each vertex on those that it is said to be on.
inline void ExpectToEndAtWalls(const WallMesh& mesh, const Domain& m) {
  const Complex rim = mesh.Rim();
  EXPECT_TRUE(m.k == 1 || RimOf(rim).empty()) << "the boundary has none";
  for (const auto& facet : rim) {
    core::WallSet common = ~core::WallSet{0};
    for (const std::uint32_t v : facet) common &= mesh.walls[v];
    EXPECT_NE(common, 0u) << "a rim that is on no wall";
  }
  for (std::size_t v = 0; v < mesh.points.size(); ++v)
    for (std::size_t w = 0; w < m.walls.size(); ++w) {
      const double g = m.walls[w](mesh.points[v], nullptr);
      const bool on = (mesh.walls[v] & core::SetOfWall(static_cast<int>(w))) != 0;
      EXPECT_TRUE(on ? std::abs(g) < 1e-9 : g > -1e-9) << "vertex " << v << ", wall " << w;
    }
}

}  // namespace stellate::testing
