// Every manifold of the promise, through the real server: certified, and judged independently.
#include <cmath>
#include <ostream>
#include <string>
#include <vector>

#include "live.h"
#include "support/mesh_judge.h"
#include "support/spoiled_oracle.h"

namespace stellate::testing {
namespace {

struct Case {
  std::string spec;
  double epsilon;  // 0.3 to 0.5 of the reach
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.spec << " at " << c.epsilon; }

class EveryManifold : public Live, public ::testing::WithParamInterface<Case> {};

TEST_P(EveryManifold, IsMeshedFaithfully) {
  const auto manifold = Make(GetParam().spec);
  ASSERT_NE(manifold, nullptr);
  const Expected<Mesh> mesh = MeshManifold(*manifold, At(GetParam().epsilon));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().reason << ": " << mesh.error().message;
  EXPECT_TRUE(IsFaithful(*mesh, *manifold, GetParam().epsilon));
  EXPECT_LE(mesh->report.certificate.max_circumradius, GetParam().epsilon);
}

INSTANTIATE_TEST_SUITE_P(Promise, EveryManifold,
                         ::testing::Values(Case{"circle:10", 0.3}, Case{"torus-knot:2:3", 0.25},
                                           Case{"ellipsoid:1:0.8:0.6", 0.14},
                                           Case{"torus:1:0.4", 0.16}, Case{"tanglecube", 0.1},
                                           Case{"clifford-torus", 0.28}, Case{"rp2:5", 0.28},
                                           Case{"rp2:6", 0.28}, Case{"two-spheres", 0.2},
                                           Case{"ellipsoid:1:0.9:0.8:0.7", 0.2},
                                           Case{"flat-torus:3", 0.4}, Case{"so3", 0.56},
                                           Case{"sphere:4", 0.6}, Case{"torus:1:0.4@60", 0.16}));

class PoorOracle : public Live, public ::testing::WithParamInterface<Case> {};

TEST_P(PoorOracle, WithClosestPointsAloneLosesNothing) {
  const auto manifold = Make(GetParam().spec);
  SpoiledOracle poor(*manifold);
  poor.intersects = poor.has_tangents = false;
  const Expected<Mesh> mesh = MeshManifold(poor, At(GetParam().epsilon));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(IsFaithful(*mesh, *manifold, GetParam().epsilon));
  EXPECT_GT(mesh->report.counts.tangent_queries, 0u);
}

INSTANTIATE_TEST_SUITE_P(Promise, PoorOracle,
                         ::testing::Values(Case{"torus-knot:2:3", 0.25}, Case{"torus:1:0.4", 0.16},
                                           Case{"rp2:5", 0.28}, Case{"so3", 0.56}));

class TooCoarse : public Live, public ::testing::WithParamInterface<Case> {};

// What comes out may look like a fine closed surface, of the wrong topology. Only one that the
// rules refined far enough to be right may be certified, whatever epsilon was.
TEST_P(TooCoarse, IsNeverFalselyCertifiedAndSaysWhy) {
  const auto manifold = Make(GetParam().spec);
  for (const std::uint64_t seed : {1, 2, 3}) {
    MeshOptions options = At(GetParam().epsilon);
    options.random_seed = seed;
    options.max_vertices = 20'000;
    const Expected<Mesh> mesh = MeshManifold(*manifold, options);
    ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
    if (mesh->report.certified()) {
      EXPECT_TRUE(IsFaithful(*mesh, *manifold, GetParam().epsilon));
    }
    const std::string& verdict = mesh->report.certificate.verdict;
    EXPECT_NE(verdict.find(mesh->report.certified() ? "Certified: " : "ot certified: "),
              std::string::npos)
        << mesh->report.text;
  }
}

INSTANTIATE_TEST_SUITE_P(FarAboveTheReach, TooCoarse,
                         ::testing::Values(Case{"torus:1:0.4", 1.6}, Case{"torus:1:0.1", 0.5},
                                           Case{"tanglecube", 1.5}, Case{"sphere:2", 5.0},
                                           Case{"torus-knot:2:3", 3.0}, Case{"so3", 6.0}));

class Symmetric : public Live {
 protected:
  // Seeds on a regular 12 x 12 grid of angles of the torus.
  static Eigen::MatrixXd GridSeeds() {
    const int n = 12;
    Eigen::MatrixXd seeds(3, n * n);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        const double u = 2 * M_PI * i / n, v = 2 * M_PI * j / n;
        seeds.col(i * n + j) << (1 + 0.4 * std::cos(v)) * std::cos(u),
            (1 + 0.4 * std::cos(v)) * std::sin(u), 0.4 * std::sin(v);
      }
    }
    return seeds;
  }
};

TEST_F(Symmetric, GridSeedsMeshAsWellAsAny) {
  const auto torus = Make("torus:1:0.4");
  SpoiledOracle seeded(*torus);
  seeded.box.reset();
  seeded.given_seeds = GridSeeds();
  const Expected<Mesh> mesh = MeshManifold(seeded, At(0.2));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(IsFaithful(*mesh, *torus, 0.2));
}

TEST_F(Symmetric, CubicalGridOnTheCliffordTorusMeshes) {
  // Cospherical by fours, exactly: every square of the grid is a degenerate Delaunay cell.
  const auto flat = Make("flat-torus:2");
  SpoiledOracle seeded(*flat);
  const int n = 16;
  Eigen::MatrixXd seeds(4, n * n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double u = 2 * M_PI * i / n, v = 2 * M_PI * j / n;
      seeds.col(i * n + j) << std::cos(u), std::sin(u), std::cos(v), std::sin(v);
    }
  }
  seeded.box.reset();
  seeded.given_seeds = seeds;
  const Expected<Mesh> mesh = MeshManifold(seeded, At(0.4));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(IsFaithful(*mesh, *flat, 0.4));
}

TEST_F(Symmetric, DuplicateSeedsCountOnce) {
  const auto torus = Make("torus:1:0.4");
  SpoiledOracle seeded(*torus);
  seeded.box.reset();
  const Eigen::MatrixXd grid = GridSeeds();
  seeded.given_seeds.resize(3, 3 * grid.cols());
  seeded.given_seeds << grid, grid, grid;
  const Expected<Mesh> mesh = MeshManifold(seeded, At(0.2));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(IsFaithful(*mesh, *torus, 0.2));
  EXPECT_GE(mesh->report.counts.duplicates, static_cast<std::uint64_t>(2 * grid.cols()));
}

TEST_F(Symmetric, OneSeedCoversAComponent) {
  const auto torus = Make("torus:1:0.4");
  SpoiledOracle seeded(*torus);
  seeded.box.reset();
  seeded.given_seeds = Eigen::Vector3d(1.3, 0.1, 0.2);
  const Expected<Mesh> mesh = MeshManifold(seeded, At(0.16));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(IsFaithful(*mesh, *torus, 0.16));
}

}  // namespace
}  // namespace stellate::testing
