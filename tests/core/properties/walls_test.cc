// Manifolds with boundary, each turned anew and with other random numbers in every trial: the mesh
// ends at its faces alone, has the right homology, and says so. The facets and the homology are
// counted here.
//
// $STELLATE_WALL_TRIALS: turns of each (1), at three sizes by turns. $STELLATE_WALL_SEED: the
// first (0). $STELLATE_WALL_ALL: those that take minutes too. $STELLATE_WALL_FIGURES: a line for
// each mesh. $STELLATE_WALL_FOUR: turns of a cut T^4 (0).

#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <string>

#include "tests/core/support/dihedrals.h"
#include "tests/core/support/domains.h"
#include "tests/core/support/wall_mesh.h"

namespace stellate::core {
namespace {

using stellate::testing::BettiNumbers;
using stellate::testing::Complex;
using stellate::testing::Domain;
using stellate::testing::MeshOf;
using stellate::testing::WallMesh;

unsigned Setting(const char* name, unsigned otherwise) {
  const char* const value = std::getenv(name);
  return value ? static_cast<unsigned>(std::atoi(value)) : otherwise;
}
unsigned FirstTrial() { return Setting("STELLATE_WALL_SEED", 0); }
unsigned EndOfTrials(unsigned each = 1) {
  return FirstTrial() + each * Setting("STELLATE_WALL_TRIALS", 1);
}

struct Case {
  std::string name;
  Domain (*make)();
  double epsilon;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name << " at " << c.epsilon; }

Domain Trial(const Case& c, unsigned trial, Specification* spec) {
  const Domain m = c.make().Turned(trial);
  *spec = m.SpecificationFor(c.epsilon * (1 - 0.15 * (trial % 3)));
  spec->random_seed = trial + 1;
  return m;
}

bool HasRightHomology(const WallMesh& mesh, const Domain& m) {
  return BettiNumbers(mesh.simplices) == m.homology &&
         BettiNumbers(mesh.Rim()) == m.boundary_homology;
}

int Euler(const std::vector<int>& betti) {
  int chi = 0;
  for (std::size_t j = 0; j < betti.size(); ++j) chi += j % 2 == 0 ? betti[j] : -betti[j];
  return chi;
}

// Degrees; of tetrahedra.
double LeastDihedral(const WallMesh& mesh) {
  double least = 180;
  for (const auto& cell : mesh.simplices)
    least = std::min(
        least, stellate::testing::DihedralAnglesOf({mesh.points[cell[0]], mesh.points[cell[1]],
                                                    mesh.points[cell[2]], mesh.points[cell[3]]})
                   .first);
  return least;
}

// What the refinement gives, degrees: more of solids, whose inner points cost no answer.
double PromisedDihedral(const Domain& m) {
  if (m.k != 3) return 0;
  return m.d == 3 ? 14 : 10;
}

class Walls : public ::testing::TestWithParam<Case> {};

TEST_P(Walls, AreWhereTheMeshEnds) {
  for (unsigned trial = FirstTrial(); trial < EndOfTrials(); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    Specification spec;
    const Domain m = Trial(GetParam(), trial, &spec);
    const WallMesh mesh = MeshOf(m, spec);
    const Certificate& c = mesh.report.certificate;
    EXPECT_EQ(mesh.report.termination, Termination::kConverged) << c.verdict;
    EXPECT_TRUE(c.certified) << c.verdict;
    EXPECT_EQ(BettiNumbers(mesh.simplices), m.homology);
    EXPECT_EQ(c.euler_characteristic, Euler(m.homology));
    const Complex rim = mesh.Rim();
    EXPECT_EQ(BettiNumbers(rim), m.boundary_homology);
    EXPECT_EQ(c.boundary_components, static_cast<std::uint64_t>(m.boundary_homology[0]));
    EXPECT_EQ(c.boundary_simplices, rim.size());
    stellate::testing::ExpectToEndAtWalls(mesh, m);
    const double dihedral = m.k == 3 ? LeastDihedral(mesh) : 180;
    EXPECT_GE(dihedral, PromisedDihedral(m) - 1e-6);
    if (Setting("STELLATE_WALL_FIGURES", 0) > 0)
      std::cout << GetParam().name << ' ' << trial << " epsilon " << spec.epsilon << " vertices "
                << mesh.points.size() << " rounds " << mesh.report.counts.rounds << " queries "
                << mesh.report.counts.queries << " angle " << c.min_angle_degrees << " dihedral "
                << dihedral << " fatness " << c.min_fatness << " radius/epsilon "
                << c.max_circumradius / spec.epsilon << '\n';
    if (HasFailure()) return;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Domains, Walls,
    ::testing::Values(Case{"arc", stellate::testing::Arc, 0.2},
                      Case{"hemisphere", stellate::testing::Hemisphere, 0.3},
                      Case{"half a torus", stellate::testing::HalfTorus, 0.1},
                      Case{"drilled torus", stellate::testing::DrilledTorus, 0.1},
                      Case{"octant", stellate::testing::Octant, 0.2},
                      Case{"disc", stellate::testing::Disc, 0.2},
                      Case{"bent disc", stellate::testing::BentDisc, 0.2},
                      Case{"annulus", stellate::testing::Annulus, 0.1},
                      Case{"Moebius strip in R^3", stellate::testing::Moebius3, 0.12},
                      Case{"Moebius strip in R^4", stellate::testing::Moebius4, 0.2},
                      Case{"half a Clifford torus", stellate::testing::HalfClifford, 0.2},
                      Case{"gyroid in a box", stellate::testing::GyroidInABox, 0.15},
                      Case{"ball", stellate::testing::Ball, 0.4},
                      Case{"shell", stellate::testing::Shell, 0.2},
                      Case{"cube", stellate::testing::Cube, 0.6},
                      Case{"box minus ball", stellate::testing::BoxMinusBall, 0.2},
                      Case{"drilled box", stellate::testing::DrilledBox, 0.2},
                      Case{"gyroid solid", stellate::testing::SmallGyroidSolid, 0.4},
                      Case{"wedge of 40 degrees", stellate::testing::Wedge40, 0.4},
                      Case{"wedge of 20 degrees", stellate::testing::Wedge20, 0.4},
                      Case{"solid torus", stellate::testing::SolidTorus, 0.16},
                      Case{"cylinder", stellate::testing::Cylinder, 0.3},
                      Case{"half of S^3", stellate::testing::HalfSphere3, 0.35},
                      Case{"T^3, cut", stellate::testing::CutTorus3, 0.35},
                      Case{"T^3, cut twice", stellate::testing::TwiceCutTorus3, 0.35},
                      Case{"joint limits", stellate::testing::JointLimits, 0.5}));

// What takes its time: most with $STELLATE_WALL_ALL alone.
std::vector<Case> SlowCases() {
  std::vector<Case> cases = {{"4-ball", stellate::testing::Ball4, 0.6},
                             {"half of S^4", stellate::testing::HalfSphere4, 0.6}};
  if (Setting("STELLATE_WALL_ALL", 0) == 0) return cases;
  cases.push_back({"large gyroid solid", stellate::testing::LargeGyroidSolid, 0.24});
  return cases;
}
INSTANTIATE_TEST_SUITE_P(Slow, Walls, ::testing::ValuesIn(SlowCases()));

// T^4 cut by a half-space, in R^8: half a minute each.
class CutFourTorus : public ::testing::TestWithParam<unsigned> {};

TEST_P(CutFourTorus, IsCertified) {
  const Domain m = stellate::testing::CutTorus4().Turned(GetParam());
  Specification spec = m.SpecificationFor(0.8);
  spec.random_seed = GetParam() + 1;
  const WallMesh mesh = MeshOf(m, spec);
  EXPECT_TRUE(mesh.report.certificate.certified) << mesh.report.certificate.verdict;
  EXPECT_TRUE(HasRightHomology(mesh, m));
}

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(CutFourTorus);
INSTANTIATE_TEST_SUITE_P(Campaign, CutFourTorus,
                         ::testing::Range(0u, Setting("STELLATE_WALL_FOUR", 0)));

// A simplex of a face that a sliver needs split is tried again, though it has failed often.
TEST(WallsTest, SliversGoWhereFacesYieldLate) {
  for (const Case& c : {Case{"gyroid solid", stellate::testing::SmallGyroidSolid, 0.4},
                        Case{"cylinder", stellate::testing::Cylinder, 0.3}}) {
    SCOPED_TRACE(c.name);
    Specification spec;
    const Domain m = Trial(c, 1009, &spec);
    const WallMesh mesh = MeshOf(m, spec);
    EXPECT_TRUE(mesh.report.certificate.certified) << mesh.report.certificate.verdict;
    EXPECT_GE(LeastDihedral(mesh), PromisedDihedral(m) - 1e-6);
  }
}

// Nor are simplices beside a face that cannot be mended made ever smaller.
TEST(WallsTest, AFaceThatStaysBadDoesNotSpoilTheInside) {
  Specification spec;
  const Domain m = Trial({"drilled box", stellate::testing::DrilledBox, 1.5}, 1, &spec);
  const WallMesh mesh = MeshOf(m, spec);
  EXPECT_FALSE(mesh.report.certificate.certified);
  EXPECT_LT(mesh.points.size(), 1000u);
}

// Far too coarse: what comes out may be anything, but then it is refused.
class CoarseWalls : public ::testing::TestWithParam<Case> {};

TEST_P(CoarseWalls, AreNeverCertifiedAsSomethingElse) {
  for (unsigned trial = FirstTrial(); trial < EndOfTrials(4); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    Specification spec;
    const Domain m = Trial(GetParam(), trial, &spec);
    spec.limits.max_vertices = 20000;
    const WallMesh mesh = MeshOf(m, spec);
    const Certificate& c = mesh.report.certificate;
    if (c.certified) {
      EXPECT_TRUE(HasRightHomology(mesh, m)) << c.verdict;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Domains, CoarseWalls,
    ::testing::Values(Case{"annulus", stellate::testing::Annulus, 1.2},
                      Case{"drilled torus", stellate::testing::DrilledTorus, 0.75},
                      Case{"half a torus", stellate::testing::HalfTorus, 1.0},
                      Case{"Moebius strip in R^4", stellate::testing::Moebius4, 1.5},
                      Case{"shell", stellate::testing::Shell, 1.2},
                      Case{"drilled box", stellate::testing::DrilledBox, 1.5},
                      Case{"solid torus", stellate::testing::SolidTorus, 1.2}));

}  // namespace
}  // namespace stellate::core
