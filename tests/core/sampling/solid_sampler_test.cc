// The interior of a manifold with boundary is sampled once its faces are meshed.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "core/sampling/sampler.h"
#include "tests/core/support/domains.h"
#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::DrivenRun;
using testing::SameMesh;
using namespace stellate::testing;  // NOLINT(google-build-using-namespace): the domains

core::testing::Answerer Answering(Domain& m) {
  return [&m](const QueryBatch& batch) { return m.AnswersOf(batch); };
}

DrivenRun MeshOfDomain(Domain m, const Specification& spec, Execution execution = {}) {
  return Drive(spec, Answering(m), execution);
}

// What the deltas add up to.
std::set<std::vector<std::uint32_t>> SimplicesOf(const DrivenRun& run, int k) {
  std::set<std::vector<std::uint32_t>> all;
  const auto each = [&](const std::vector<std::uint32_t>& ids, const auto& take) {
    const auto width = static_cast<std::ptrdiff_t>(k) + 1;
    for (auto at = ids.begin(); at != ids.end(); at += width)
      take(std::vector<std::uint32_t>(at, at + width));
  };
  for (const MeshDelta& delta : run.deltas) {
    each(delta.removed, [&](const auto& s) { EXPECT_EQ(all.erase(s), 1u); });
    each(delta.added, [&](const auto& s) { EXPECT_TRUE(all.insert(s).second); });
  }
  return all;
}

std::set<std::vector<std::uint32_t>> SimplicesOf(const Mesher& mesher, int k) {
  const std::vector<std::uint32_t> ids = mesher.Simplices();
  std::set<std::vector<std::uint32_t>> all;
  for (auto at = ids.begin(); at != ids.end(); at += k + 1) all.insert({at, at + k + 1});
  return all;
}

struct Interior {
  const char* name;
  Domain (*make)();
  double epsilon;
  double volume;
  double most;  // vertices times epsilon^k over the volume
};

class InteriorTest : public ::testing::TestWithParam<Interior> {};

// Point by point 0.71 to 0.83 for k = 2; for k = 3, where much of it is the boundary, 0.86 to 0.92.
TEST_P(InteriorTest, HasFewerVertices) {
  const Interior& sampled = GetParam();
  const Domain m = sampled.make();
  const DrivenRun run = MeshOfDomain(m, m.SpecificationFor(sampled.epsilon));
  EXPECT_TRUE(run.report().certificate.certified) << run.report().certificate.verdict;
  const auto vertices = static_cast<double>(run.report().counts.vertices);
  EXPECT_LT(vertices * std::pow(sampled.epsilon, m.k) / sampled.volume, sampled.most);
  EXPECT_EQ(SimplicesOf(run, m.k), SimplicesOf(*run.mesher, m.k));
}

INSTANTIATE_TEST_SUITE_P(
    All, InteriorTest,
    ::testing::Values(
        Interior{"disc", Disc, 0.05, std::numbers::pi, 0.6},
        Interior{"hemisphere", Hemisphere, 0.05, 1.8 * std::numbers::pi, 0.6},
        Interior{"half a Clifford torus", HalfClifford, 0.1,
                 1.9 * std::numbers::pi* std::numbers::pi, 0.6},
        Interior{"ball", Ball, 0.1, 4 * std::numbers::pi / 3, 0.7},
        Interior{"solid torus", SolidTorus, 0.1, 0.72 * std::numbers::pi* std::numbers::pi, 0.9},
        Interior{"half of S^3", HalfSphere3, 0.2, std::numbers::pi* std::numbers::pi, 0.87}),
    [](const auto& sampled) {
      std::string name = sampled.param.name;
      std::erase_if(name, [](char c) { return !std::isalnum(c); });
      return name;
    });

TEST(InteriorLaying, IsTheSameForAnyThreads) {
  for (const Domain& m : {Ball(), HalfSphere3(), BoxMinusBall()}) {
    const Specification spec = m.SpecificationFor(0.25);
    const DrivenRun one = MeshOfDomain(m, spec, {.threads = 1});
    const DrivenRun many = MeshOfDomain(m, spec, {.threads = 4});
    EXPECT_TRUE(SameMesh(*one.mesher, *many.mesher));
  }
}

// Each round may be the last: what was sampled gets its stars, and what was there is given up for
// them.
TEST(InteriorLaying, EndsWithAMeshOfWhatItHas) {
  for (const Domain& m : {Ball(), Hemisphere(), HalfSphere3()}) {
    Specification spec = m.SpecificationFor(0.3);
    const auto rounds = MeshOfDomain(m, spec).report().counts.rounds;
    for (std::uint64_t most = 1; most < rounds; ++most) {
      spec.limits.max_rounds = most;
      const DrivenRun run = MeshOfDomain(m, spec);
      EXPECT_EQ(SimplicesOf(run, m.k), SimplicesOf(*run.mesher, m.k)) << most << " rounds";
    }
  }
}

TEST(InteriorLaying, KeepsToItsVertices) {
  for (const Domain& m : {Ball(), HalfSphere3()}) {
    Specification spec = m.SpecificationFor(0.2);
    spec.limits.max_vertices = 300;
    const DrivenRun run = MeshOfDomain(m, spec);
    EXPECT_EQ(run.report().termination, Termination::kVertexBudget);
    EXPECT_EQ(run.report().counts.vertices, 300u);
    EXPECT_EQ(SimplicesOf(run, m.k), SimplicesOf(*run.mesher, m.k));
  }
}

// All of the plane but a disc: it was laid up to the limit of vertices in one round, and a server
// had no chance to see how much memory that takes.
TEST(InteriorLaying, StopsSoonAfterItHasLeftTheBox) {
  Domain m = stellate::testing::Make(2, 2, 1.3, {1, 1, 0}, {2, 2});
  m.walls = {stellate::testing::BallOf(Vector2d::Zero(), 0.5, 1, 2)};
  Specification spec = m.SpecificationFor(0.04);
  spec.limits.max_vertices = 1'000'000;
  const auto mesher = core::testing::NewMesher(spec);
  std::uint64_t before = 0, largest_step = 0;
  while (mesher->NextBatch()) {
    core::testing::Step(*mesher, Answering(m));
    const std::uint64_t now = mesher->progress().vertices;
    largest_step = std::max(largest_step, now - before);
    before = now;
  }
  EXPECT_EQ(mesher->report().termination, Termination::kNoProgress);
  EXPECT_NE(mesher->report().certificate.verdict.find("leaves the bounding box"), std::string::npos)
      << mesher->report().certificate.verdict;
  EXPECT_LT(mesher->report().counts.vertices, 200'000u);
  EXPECT_LT(largest_step, 70'000u);
}

TEST(InteriorLaying, MayBeCancelledAnywhere) {
  for (Domain m : {Ball(), HalfSphere3()}) {
    const Specification spec = m.SpecificationFor(0.3);
    const auto rounds = MeshOfDomain(m, spec).report().counts.rounds;
    for (std::uint64_t some = 1; some < rounds; ++some) {
      const auto mesher = core::testing::NewMesher(spec);
      for (std::uint64_t round = 0; round < some; ++round)
        core::testing::Step(*mesher, Answering(m));
      mesher->Cancel();
      EXPECT_EQ(mesher->report().termination, Termination::kCancelled);
      for (const std::uint32_t v : mesher->Simplices())
        ASSERT_LT(v, mesher->report().counts.vertices);
    }
  }
}

// A wall of two parts, of which the seeds show one: the lattice runs into the other.
TEST(InteriorLaying, FindsWallsThatNoSeedHasShown) {
  Domain m = stellate::testing::Make(2, 3, 1.3, {1, 1, 0}, {2, 2});
  m.equations = {BallOf(Vector3d::Zero(), 1, 1, 3)};
  m.walls = {[](const VectorXd& p, VectorXd* g) {
    if (g) *g = -2 * p[2] * Vector3d::UnitZ();
    return 0.5 - p[2] * p[2];
  }};
  Specification spec = m.SpecificationFor(0.08);
  spec.seeds = Vector3d(0.7, 0.1, 0.65);
  const DrivenRun run = MeshOfDomain(m, spec);
  EXPECT_TRUE(run.report().certificate.certified) << run.report().certificate.verdict;
  EXPECT_EQ(run.report().certificate.boundary_components, 2u);
  EXPECT_EQ(run.report().certificate.euler_characteristic, 0);
}

}  // namespace
}  // namespace stellate::core
