// The engine by itself, driven by hand on the unit sphere.

#include "core/refinement/engine.h"

#include <gtest/gtest.h>

#include "tests/core/support/in_process_run.h"
#include "tests/core/support/unit_sphere.h"

namespace stellate::core {
namespace {

using testing::EngineOnSphere;
using testing::Octahedron;
using testing::SphereSpec;
using testing::StepOnSphere;

std::uint64_t Finish(Engine<2>* engine, std::uint64_t round) {
  while (StepOnSphere(engine, round)) ++round;
  return round;
}

TEST(Engine, EndsWhenAllRulesHold) {
  Engine<2> engine = EngineOnSphere(SphereSpec(0.3), Octahedron());
  Finish(&engine, 1);
  EXPECT_TRUE(engine.AllRulesHold());
  EXPECT_EQ(engine.simplex_count(), engine.Simplices().size() / 3);
  const auto topology = testing::TopologyOf(engine.Simplices(), 2);
  EXPECT_TRUE(topology.closed);
  EXPECT_EQ(topology.euler_characteristic, 2);
  for (std::uint32_t p = 0; p < engine.stars().size(); ++p)
    EXPECT_LE(engine.stars().cell(p).max_norm2(), 0.3 * 0.3 * (1 + 1e-9));
}

TEST(Engine, IsAValueThatGoesOnByItself) {
  Engine<2> engine = EngineOnSphere(SphereSpec(0.2), Octahedron());
  std::uint64_t round = 1;
  while (round < 4) ASSERT_TRUE(StepOnSphere(&engine, round++));
  const std::vector<double> before = engine.stars().sample().points();
  Engine<2> copy(engine);
  const std::uint64_t end = Finish(&copy, round);
  EXPECT_EQ(engine.stars().sample().points(), before);
  EXPECT_GT(copy.stars().size(), engine.stars().size());
  EXPECT_EQ(Finish(&engine, round), end);
  EXPECT_EQ(engine.stars().sample().points(), copy.stars().sample().points());
  EXPECT_EQ(engine.Simplices(), copy.Simplices());
}

TEST(Engine, TellsHowManyVerticesAreMissing) {
  Engine<2> engine = EngineOnSphere(SphereSpec(0.1), Octahedron());
  const double missing = engine.CountMissing(1);
  EXPECT_GT(missing, 100);
  EXPECT_EQ(engine.CountMissing(0.5), 0.5 * missing);
  Finish(&engine, 1);
  EXPECT_EQ(engine.CountMissing(1), 0);
}

TEST(Engine, KeepsToItsVertices) {
  Specification spec = SphereSpec(0.1);
  spec.limits.max_vertices = 40;
  Engine<2> engine = EngineOnSphere(spec, Octahedron());
  for (std::uint64_t round = 1; !engine.is_full(); ++round)
    ASSERT_TRUE(StepOnSphere(&engine, round));
  EXPECT_EQ(engine.stars().size(), 40u);
}

TEST(Engine, JudgesAllAnewWhereItIsTold) {
  Engine<2> engine = EngineOnSphere(SphereSpec(0.4), Octahedron());
  Finish(&engine, 1);
  EXPECT_FALSE(engine.violations().are_all_dirty());
  engine.MarkAllDirty();
  EXPECT_TRUE(engine.violations().are_all_dirty());
  ASSERT_TRUE(engine.Plan());
  EXPECT_TRUE(engine.AllRulesHold());
}

}  // namespace
}  // namespace stellate::core
