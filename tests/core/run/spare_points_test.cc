#include "core/run/spare_points.h"

#include <gtest/gtest.h>

#include "tests/core/support/unit_sphere.h"

namespace stellate::core {
namespace {

using testing::EngineOnSphere;
using testing::Octahedron;
using testing::SphereSpec;

// What was answered at 0, 4 and 10 on the x-axis, of which the first was used.
SparePoints KeptOnAxis() {
  AnsweredPoints answers;
  answers.points = Eigen::MatrixXd::Zero(3, 4);
  answers.points.row(0) << 0, 4, 10, 20;
  answers.answered = {1, 1, 1, 0};
  SparePoints spare(3);
  spare.Keep(answers, {1, 0, 0, 0});
  return spare;
}

TEST(SparePoints, AreThoseAnsweredAndNotUsed) {
  EXPECT_EQ(KeptOnAxis().Take().points, (std::vector<double>{4, 0, 0, 10, 0, 0}));
}

// One of the five answers is beyond wall 0, one was not found, and one has no clearances.
TEST(SparePoints, KeepTheClearancesOfAllAnswers) {
  AnsweredPoints answers;
  answers.points = Eigen::MatrixXd::Zero(2, 5);
  answers.points.row(0) << 1, 2, 3, 4, 5;
  answers.found = {1, 1, 0, 1, 1};
  answers.walls = {0, 0, 0, SetOfWall(1), 0};
  answers.clearances.resize(2, 5);
  answers.clearances << 0.5, -0.5, 1, 0.25, INFINITY,  //
      0.7, 0.7, 1, -1e-17, INFINITY;
  SparePoints spare(2);
  spare.KeepClearances(answers, 100);
  const ClearPoints clear = spare.Take().clear;
  EXPECT_EQ(clear.points, (std::vector<double>{1, 0, 4, 0}));
  EXPECT_EQ(clear.clearances, (std::vector<double>{0.5, 0.7, 0.25, 0}));
}

TEST(SparePoints, AreUncoveredFarFromTheSample) {
  const Engine<2> engine = EngineOnSphere(SphereSpec(0.5), Octahedron());
  AnsweredPoints answers;
  answers.points.resize(3, 2);
  answers.points << 0.6, 100, 0.6, 0, 0.5, 0;
  answers.answered = {1, 1};
  SparePoints spare(3);
  spare.Keep(answers, {0, 0});
  EXPECT_EQ(spare.Uncovered(engine.stars()), (std::vector<double>{100, 0, 0}));
}

TEST(SparePoints, AreChosenApartAndNotForEver) {
  const Engine<2> engine = EngineOnSphere(SphereSpec(0.5), Octahedron());
  SparePoints spare(3);
  EXPECT_EQ(spare.Choose({}, engine.stars(), 0.5).cols(), 0);
  // Two that lie together, and one by itself.
  const std::vector<double> points = {5, 0, 0, 5.1, 0, 0, 9, 0, 0};
  int times = 0;
  while (true) {
    const Eigen::MatrixXd chosen = spare.Choose(points, engine.stars(), 0.5);
    if (chosen.cols() == 0) break;
    ASSERT_EQ(chosen.cols(), 2);
    EXPECT_EQ(chosen(0, 0), 5);
    EXPECT_EQ(chosen(0, 1), 9);
    ASSERT_LT(++times, 1000);
  }
  EXPECT_GT(times, 1);
}

}  // namespace
}  // namespace stellate::core
