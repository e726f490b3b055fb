#pragma once

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
  while (const core::QueryBatch* batch = (*mesher)->NextBatch()) {
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

}  // namespace stellate::testing
