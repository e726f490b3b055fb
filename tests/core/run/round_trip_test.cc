#include "core/run/round_trip.h"

#include <gtest/gtest.h>

#include "core/base/basis_layout.h"
#include "tests/core/support/unit_sphere.h"

namespace stellate::core {
namespace {

using testing::EngineOnSphere;
using testing::Octahedron;
using testing::OnSphere;
using testing::SphereSpec;

constexpr double kTangentStep = 1e-3;

class RoundTripTest : public ::testing::Test {
 protected:
  RoundTripTest() : engine_(EngineOnSphere(SphereSpec(0.5), Octahedron())) {}

  CandidateSet<2> Draw() {
    CandidateSet<2> candidates = engine_.Draw(engine_.Select(*engine_.Plan()), 1);
    EXPECT_GT(candidates.targets.size(), 1u);
    return candidates;
  }

  // Questions and answers until it is done; closest points, whatever is asked.
  std::vector<std::vector<QueryBlock>> Run(RoundTrip<2>& trip) {
    std::vector<std::vector<QueryBlock>> asked;
    for (auto blocks = trip.Questions(); !blocks.empty(); blocks = trip.Questions()) {
      std::vector<AnswerBlock> answers;
      for (const QueryBlock& block : blocks) {
        const AnsweredPoints on = OnSphere(block.points);
        AnswerBlock answer;
        answer.points = on.points;
        if (block.want.tangents) {
          answer.tangents.resize(6, block.size());
          for (Eigen::Index i = 0; i < block.size(); ++i)
            ToByCoordinate(on.tangents.col(i).data(), 3, 2, answer.tangents.col(i).data());
        }
        answers.push_back(std::move(answer));
      }
      for_tangents_.push_back(trip.asks_for_tangents());
      trip.Absorb(answers);
      asked.push_back(std::move(blocks));
    }
    return asked;
  }

  static void ExpectOrthonormal(const AnsweredPoints& answers) {
    for (Eigen::Index i = 0; i < answers.points.cols(); ++i) {
      const Eigen::Map<const Eigen::Matrix<double, 3, 2>> basis(answers.tangents.col(i).data());
      EXPECT_LT((basis.transpose() * basis - Eigen::Matrix2d::Identity()).norm(), 1e-9);
      EXPECT_LT((basis.transpose() * answers.points.col(i)).norm(), 1e-3);
    }
  }

  Engine<2> engine_;
  TangentFinder finder_{2, 3, kTangentStep, 1};
  std::vector<bool> for_tangents_;
};

TEST_F(RoundTripTest, AsksOnceWhereTheClientHasAll) {
  const CandidateSet<2> candidates = Draw();
  RoundTrip<2> trip(engine_, {true, true, false}, finder_, candidates);
  const auto asked = Run(trip);
  ASSERT_EQ(asked.size(), 1u);
  ASSERT_EQ(asked[0].size(), 1u);
  const QueryBlock& flats = asked[0][0];
  EXPECT_EQ(flats.kind, QueryKind::kIntersectFlat);
  EXPECT_TRUE(flats.want.tangents);
  EXPECT_EQ(flats.points, candidates.points);
  double by_vector[6];
  ToByVector(flats.bases.col(1).data(), 3, 2, by_vector);
  for (int i = 0; i < 6; ++i)
    EXPECT_EQ(by_vector[i], engine_.stars().sample().Tangent(candidates.targets[1].star)[i]);
  EXPECT_EQ(flats.radii[1], candidates.targets[1].radius);
  EXPECT_EQ(trip.answers().points, OnSphere(candidates.points).points);
  EXPECT_EQ(trip.answers().tangents, OnSphere(candidates.points).tangents);
}

TEST_F(RoundTripTest, SortsMixedBlocksBackIntoCandidates) {
  CandidateSet<2> candidates = Draw();
  candidates.in_flats[0] = 0;
  candidates.planned.points = Eigen::Vector3d(1, 2, 3);
  RoundTrip<2> trip(engine_, {true, true, false}, finder_, candidates);
  const auto asked = Run(trip);
  ASSERT_EQ(asked.size(), 1u);
  ASSERT_EQ(asked[0].size(), 3u);
  EXPECT_EQ(asked[0][1].points.col(0), candidates.points.col(0));
  EXPECT_EQ(asked[0][2].points.col(0), candidates.planned.points.col(0));
  EXPECT_EQ(trip.answers().points, OnSphere(candidates).points);
}

TEST_F(RoundTripTest, FindsTangentsWhereTheClientGivesNone) {
  const CandidateSet<2> candidates = Draw();
  RoundTrip<2> trip(engine_, {true, false, false}, finder_, candidates);
  const auto asked = Run(trip);
  ASSERT_GE(asked.size(), 2u);
  EXPECT_FALSE(for_tangents_[0]);
  EXPECT_TRUE(for_tangents_[1]);
  EXPECT_EQ(trip.answers().found, std::vector<std::uint8_t>(candidates.targets.size(), 1));
  ExpectOrthonormal(trip.answers());
}

TEST_F(RoundTripTest, GoesBackToTheFlatBeforeEachFurtherClosestPoint) {
  Specification spec = SphereSpec(0.5);
  spec.oracle.intersect_flat = false;
  spec.criteria.flat_alternations = 3;
  Engine<2> engine = EngineOnSphere(spec, Octahedron());
  const CandidateSet<2> candidates = engine.Draw(engine.Select(*engine.Plan()), 1);
  RoundTrip<2> trip(engine, spec.oracle, finder_, candidates);
  const auto asked = Run(trip);
  ASSERT_EQ(asked.size(), 3u);
  for (std::size_t i = 0; i < candidates.targets.size(); ++i) {
    const auto c = static_cast<Eigen::Index>(i);
    if (candidates.targets[i].violation.fake) continue;
    const double* tangent = engine.stars().sample().Tangent(candidates.targets[i].star);
    const Eigen::Map<const Eigen::Matrix<double, 3, 2>> basis(tangent);
    const Eigen::Vector3d off = asked[1][0].points.col(c) - candidates.points.col(c);
    EXPECT_LT((basis.transpose() * off).norm(), 1e-12);
    // Nearer to the flat each time.
    const Eigen::Vector3d first = OnSphere(asked[0][0].points).points.col(c);
    const Eigen::Vector3d last = trip.answers().points.col(c);
    EXPECT_LE((basis.transpose() * (last - candidates.points.col(c))).norm(),
              (basis.transpose() * (first - candidates.points.col(c))).norm() + 1e-12);
  }
}

TEST_F(RoundTripTest, AsksForSeedsAsPlannedPoints) {
  CandidateSet<2> candidates;
  candidates.planned.points = Octahedron();
  RoundTrip<2> trip(engine_, {false, false, false}, finder_, candidates);
  const auto asked = Run(trip);
  EXPECT_EQ(asked[0].size(), 1u);
  EXPECT_EQ(asked[0][0].kind, QueryKind::kClosestPoint);
  EXPECT_EQ(trip.answers().points, Octahedron());
  ExpectOrthonormal(trip.answers());
}

}  // namespace
}  // namespace stellate::core
