// Which meshes begin with a lattice, before there is any star.

#include "core/sampling/sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "tests/core/support/in_process_run.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::Make;
using testing::SpecificationFor;

struct Dense {
  const char* manifold;
  double epsilon;
  double volume;
  double most;  // vertices times epsilon^3 over the volume; without a lattice they are 0.7
};

constexpr double kPi = std::numbers::pi;

class LatticeSampleTest : public ::testing::TestWithParam<Dense> {};

TEST_P(LatticeSampleTest, HasFewerVerticesInThreeDimensions) {
  const Dense& dense = GetParam();
  const auto manifold = Make(dense.manifold);
  const auto run = Drive(SpecificationFor(*manifold, dense.epsilon), *manifold);
  EXPECT_TRUE(run.report().certificate.certified) << run.report().certificate.verdict;
  const double vertices = static_cast<double>(run.report().counts.vertices);
  EXPECT_LT(vertices * std::pow(dense.epsilon, 3) / dense.volume, dense.most);
  // It grows ring by ring, and has no simplices meanwhile.
  EXPECT_GT(run.deltas[2].first_vertex, run.deltas[1].first_vertex);
  EXPECT_TRUE(run.deltas[2].added.empty());
}

INSTANTIATE_TEST_SUITE_P(All, LatticeSampleTest,
                         ::testing::Values(Dense{"flat-torus:3", 0.4, 8 * kPi* kPi* kPi, 0.55},
                                           Dense{"sphere:3", 0.18, 2 * kPi* kPi, 0.66}));

// Whether vertices come ring by ring, and simplices later.
bool IsSampled(const char* name, double epsilon, bool speculative = false) {
  const auto manifold = Make(name);
  Specification spec = SpecificationFor(*manifold, epsilon);
  spec.criteria.speculative = speculative;
  spec.limits.max_rounds = 4;
  const auto run = Drive(spec, *manifold);
  return run.deltas[3].first_vertex > run.deltas[2].first_vertex && run.deltas[2].added.empty();
}

// Few of their seeds lie far from each other, even where thousands of vertices will be needed.
TEST(Sampler, BeginsLargeMeshesOfFourDimensions) {
  EXPECT_TRUE(IsSampled("flat-torus:4", 0.8));  // 3,600 vertices
  EXPECT_TRUE(IsSampled("sphere:4", 0.3));      // 2,800
  EXPECT_FALSE(IsSampled("sphere:4", 0.5));     // 360
  EXPECT_TRUE(IsSampled("flat-torus:4", 0.6, true));
}

class Given : public ::testing::TestWithParam<const char*> {};

// The points of a mesh are a sample: they are kept, and no lattice is added between them.
TEST_P(Given, SampleIsLeft) {
  const auto manifold = Make(GetParam());
  Specification spec = SpecificationFor(*manifold, 0.5);
  const auto first = Drive(spec, *manifold);
  spec.seeds = first.mesher->Points();
  const auto again = Drive(spec, *manifold);
  const auto vertices = static_cast<double>(first.report().counts.vertices);
  EXPECT_LT(static_cast<double>(again.report().counts.vertices), 1.1 * vertices);
  EXPECT_FALSE(again.deltas[0].added.empty());
}

INSTANTIATE_TEST_SUITE_P(Sampler, Given, ::testing::Values("flat-torus:3", "sphere:4"));

// The coarse lattice that goes before counts, too: nobody is asked to find their way around all of
// M for vertices that there is no room for.
TEST(Sampler, EndsWhereThereIsNoRoomForMoreVertices) {
  const auto manifold = Make("sphere:2:3");
  Specification spec = SpecificationFor(*manifold, 0.001);
  spec.limits.max_vertices = 200;
  const auto run = Drive(spec, *manifold);
  EXPECT_EQ(run.report().termination, Termination::kVertexBudget);
  EXPECT_EQ(run.report().counts.vertices, 200);
  EXPECT_LT(run.report().counts.queries, 2000);
}

}  // namespace
}  // namespace stellate::core
