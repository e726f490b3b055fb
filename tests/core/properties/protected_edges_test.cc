// Solids with sharp curved edges, and with corners of more walls than three: they close, are
// certified, and are what their functions say. Counted here, by the list of simplices and the
// walls' functions alone.
//
// $STELLATE_WALL_TRIALS: turns of each (1).

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <functional>
#include <numbers>
#include <string>

#include "core/base/message.h"
#include "tests/core/support/domains.h"
#include "tests/core/support/wall_mesh.h"

namespace stellate::core {
namespace {

using stellate::testing::BettiNumbers;
using stellate::testing::Domain;
using stellate::testing::MeshOf;
using stellate::testing::WallMesh;

struct Solid {
  std::string name;
  std::function<Domain()> make;
  double epsilon;
  std::vector<int> homology;
  double volume = 0;  // 0: not known
};
void PrintTo(const Solid& solid, std::ostream* out) { *out << solid.name; }

double VolumeOf(const WallMesh& mesh) {
  double volume = 0;
  for (const auto& cell : mesh.simplices) {
    Eigen::Matrix3d edges;
    for (Eigen::Index i = 0; i < 3; ++i)
      edges.col(i) = mesh.points[cell[static_cast<std::size_t>(i) + 1]] - mesh.points[cell[0]];
    volume += std::abs(edges.determinant()) / 6;
  }
  return volume;
}

class SharpSolids : public ::testing::TestWithParam<Solid> {};

TEST_P(SharpSolids, CloseAndAreCertified) {
  const char* const trials = std::getenv("STELLATE_WALL_TRIALS");
  for (unsigned trial = 0; trial < (trials ? static_cast<unsigned>(std::atoi(trials)) : 1u);
       ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Domain m = GetParam().make().Turned(trial);
    Specification spec = m.SpecificationFor(GetParam().epsilon);
    spec.random_seed = trial + 1;
    spec.limits.max_vertices = 20000;
    const WallMesh mesh = MeshOf(m, spec);
    const Certificate& c = mesh.report.certificate;
    ASSERT_TRUE(c.certified) << c.verdict << mesh.report.failure.message;
    EXPECT_EQ(BettiNumbers(mesh.simplices), GetParam().homology);
    stellate::testing::ExpectToEndAtWalls(mesh, m);
    if (GetParam().volume > 0) {
      EXPECT_NEAR(VolumeOf(mesh) / GetParam().volume, 1, 0.05);
    }
  }
}

std::vector<Solid> Solids() {
  constexpr double kPi = std::numbers::pi, kCell = 8 * kPi * kPi * kPi;
  std::vector<Solid> solids;
  const auto cell = [&](const std::string& name, const Eigen::Vector3d& low, double epsilon,
                        std::vector<int> homology) {
    solids.push_back({"gyroid in a cell from " + name,
                      [low] { return stellate::testing::GyroidCell(low); }, epsilon,
                      std::move(homology), kCell / 2});
  };
  for (const double epsilon : {0.45, 0.36}) {
    cell("(.3, .4, .5)", {0.3, 0.4, 0.5}, epsilon, {2, 2, 0, 0});
    cell("its corner", {0, 0, 0}, epsilon, {1, 2, 0, 0});
    cell("its middle", {kPi, kPi, kPi}, epsilon, {1, 2, 0, 0});
  }
  // Where rounding finds the gyroid's one point in a corner inside of all other walls.
  for (const unsigned turn : {1u, 3u, 5u})
    solids.push_back({"gyroid in a cell from its middle, turned",
                      [turn, middle = Eigen::Vector3d(kPi, kPi, kPi)] {
                        return stellate::testing::GyroidCell(middle).Turned(turn);
                      },
                      0.45,
                      {1, 2, 0, 0},
                      kCell / 2});
  for (const double degrees : {55.0, 52.0, 50.5, 50.0, 45.0, 35.0, 25.0, 20.0})
    for (const double share : {0.4, 0.2}) {
      const double half = degrees * kPi / 360, up = std::cos(half);
      solids.push_back({"lens of " + Brief(degrees) + " degrees",
                        [degrees] { return stellate::testing::Lens(degrees); },
                        share * std::sin(half),
                        {1, 0, 0, 0},
                        share < 0.3 ? 2 * kPi * (1 - up) * (1 - up) * (2 + up) / 3 : 0});
    }
  for (const double epsilon : {0.3, 0.2}) {
    solids.push_back({"octahedron", stellate::testing::Octahedron, epsilon, {1, 0, 0, 0}, 4.0 / 3});
    solids.push_back({"pyramid", stellate::testing::Pyramid, epsilon, {1, 0, 0, 0}});
  }
  return solids;
}
INSTANTIATE_TEST_SUITE_P(Domains, SharpSolids, ::testing::ValuesIn(Solids()));

}  // namespace
}  // namespace stellate::core
