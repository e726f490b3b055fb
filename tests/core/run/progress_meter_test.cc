// How far a run is.

#include "core/run/progress_meter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/core/support/in_process_run.h"
#include "tests/core/support/unit_sphere.h"

namespace stellate::core {
namespace {

using testing::AnswererFor;
using testing::EngineOnSphere;
using testing::Octahedron;
using testing::SphereSpec;
using testing::StepOnSphere;

TEST(ProgressMeter, FollowsTheMesh) {
  const Specification spec = SphereSpec(0.2);
  Engine<2> empty(spec, Resolve(spec));
  Progress progress;
  ProgressMeter meter(spec);
  meter.Measure<2>(empty, false, 0, &progress);
  EXPECT_EQ(progress.phase, Phase::kSeeding);
  EXPECT_EQ(progress.fraction, 0);

  Engine<2> engine = EngineOnSphere(spec, Octahedron());
  progress.queries = 6;
  meter.Measure<2>(engine, false, 0, &progress);
  EXPECT_EQ(progress.phase, Phase::kRefining);
  EXPECT_EQ(progress.vertices, 6u);
  EXPECT_EQ(progress.bad_size, 6u);
  EXPECT_EQ(progress.unbounded_stars, 6u);  // too far from each other to see each other yet
  double before = progress.fraction;
  for (std::uint64_t round = 1; StepOnSphere(&engine, round); ++round) {
    meter.Measure<2>(engine, false, 0, &progress);
    EXPECT_GE(progress.fraction, before);
    before = progress.fraction;
  }
  EXPECT_EQ(progress.simplices, engine.simplex_count());
  EXPECT_EQ(progress.unbounded_stars, 0u);
  EXPECT_EQ(progress.bad_size + progress.bad_radius_edge, 0u);
  EXPECT_EQ(progress.bad_sliver + progress.bad_inconsistent, 0u);
  meter.Measure<2>(engine, true, 0, &progress);
  EXPECT_EQ(progress.phase, Phase::kCertifying);
  EXPECT_GE(progress.fraction, before);
  EXPECT_LT(progress.fraction, 1);
}

// By round: what a run said, and the share of its questions that had been answered.
struct Told {
  Progress progress;
  double share = 0;
};

std::vector<Told> ProgressOf(const Specification& spec, const testing::Answerer& answer) {
  const auto mesher = testing::NewMesher(spec);
  std::vector<Told> all;
  while (mesher->NextBatch()) {
    testing::Step(*mesher, answer);
    all.push_back({mesher->progress(), 0});
  }
  for (Told& said : all)
    said.share = static_cast<double>(said.progress.queries) /
                 static_cast<double>(all.back().progress.queries);
  return all;
}

struct Watched {
  std::string manifold;
  double epsilon = 0;
  bool ahead = false;
};

TEST(ProgressMeter, TellsTheShareOfTheQuestions) {
  for (const Watched& c :
       {Watched{"torus", 0.08}, Watched{"torus", 0.05, true}, Watched{"sphere:2", 0.1},
        Watched{"so3", 0.5}, Watched{"flat-torus:3", 0.5}, Watched{"torus-knot:2:3", 0.05},
        Watched{"ellipsoid:1:0.6:0.4", 0.06}, Watched{"rp2", 0.15}}) {
    const auto manifold = testing::Make(c.manifold);
    Specification spec = testing::SpecificationFor(*manifold, c.epsilon);
    spec.criteria.speculative = c.ahead;
    const std::vector<Told> all = ProgressOf(spec, AnswererFor(*manifold));
    std::size_t foreseeable = 0;
    double before = 0;
    for (const Told& said : all) {
      EXPECT_GE(said.progress.fraction, before);
      before = said.progress.fraction;
      if (&said == &all.back()) break;
      EXPECT_LT(said.progress.fraction, said.share + 0.3)
          << c.manifold << " round " << said.progress.round;
      if (!said.progress.is_foreseeable) continue;
      ++foreseeable;
      EXPECT_NEAR(said.progress.fraction, said.share, 0.3)
          << c.manifold << " round " << said.progress.round;
    }
    EXPECT_EQ(before, 1) << c.manifold;
    EXPECT_GE(8 * foreseeable, all.size()) << c.manifold << ": known for a while";
    EXPECT_FALSE(all.back().progress.is_foreseeable) << "it is over";
  }
}

// Waves shorter than epsilon: rules are broken as fast as they are mended.
TEST(ProgressMeter, SaysNothingOfTheTimeWhereNothingIsMended) {
  const auto sphere = testing::Make("sphere:2");
  Specification spec = testing::SpecificationFor(*sphere, 0.3);
  spec.oracle = {};
  spec.limits.max_rounds = 100;
  const auto answer = [&](const QueryBatch& batch) {
    Answers answers = testing::AnswersOf(*sphere, batch);
    for (AnswerBlock& block : answers.blocks)
      for (Eigen::Index j = 0; j < block.points.cols(); ++j) {
        const Eigen::VectorXd x = block.points.col(j);
        block.points.col(j) += 0.2 * spec.epsilon * std::sin(60 * x.sum() / spec.epsilon) * x;
      }
    return answers;
  };
  const std::vector<Told> all = ProgressOf(spec, answer);
  ASSERT_EQ(all.size(), 100u);
  for (const Told& said : all) {
    EXPECT_LT(said.progress.fraction, 0.85) << said.progress.round;
    if (said.progress.round <= 40) continue;
    EXPECT_FALSE(said.progress.is_foreseeable) << said.progress.round;
  }
}

}  // namespace
}  // namespace stellate::core
