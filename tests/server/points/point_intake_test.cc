// Points on their way from a client to a run: in order, checked, and none of them lost.
#include "server/points/point_intake.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <thread>

namespace stellate::server {
namespace {

using core::StatusCode;
using ::testing::HasSubstr;

constexpr std::uint64_t kPoints = 10;

struct Stream final : PointStream {
  void Proceed() override { ++proceeded; }
  void End(const core::Status& status) override { ends.push_back(status); }
  int proceeded = 0;
  std::vector<core::Status> ends;
};

PointsRequest Request(bool tangents = false) {
  PointsRequest request;
  request.spec.dimension = 2;
  request.spec.ambient_dimension = 3;
  request.points = kPoints;
  request.has_tangents = tangents;
  return request;
}

PointsPart Part(std::uint64_t first, Eigen::Index count) {
  PointsPart part;
  part.first_row = first;
  part.points.resize(3, count);
  for (Eigen::Index i = 0; i < count; ++i)
    part.points.col(i).setConstant(static_cast<double>(first) + static_cast<double>(i));
  return part;
}

core::QueryBatch Batch(Eigen::Index rows) {
  core::QueryBatch batch;
  if (rows > 0) batch.blocks.emplace_back().points.setZero(3, rows);
  return batch;
}

std::string Digest() {
  Sha256 digest;
  const PointsPart all = Part(0, kPoints);
  digest.Add(all.points.data(), static_cast<std::size_t>(all.points.size()) * sizeof(double));
  return digest.Value();
}

TEST(PointIntake, HandsOverRoundsOfItsOwnSize) {
  PointIntake intake(Request(), std::chrono::seconds(60));
  const auto stream = std::make_shared<Stream>();
  ASSERT_TRUE(intake.Join(stream).ok());
  EXPECT_EQ(stream->proceeded, 0);  // the replay may not be over
  std::thread session([&] {
    for (const Eigen::Index rows : {4, 4, 2}) {
      const auto outcome = intake.Ask(Batch(rows));
      ASSERT_TRUE(outcome.answers);
      const Eigen::MatrixXd& points = outcome.answers->blocks[0].points;
      EXPECT_EQ(points, Part(intake.rows(), rows).points);
      intake.Note(*outcome.answers);
    }
    const auto end = intake.Ask(Batch(0));
    ASSERT_TRUE(end.answers);
    EXPECT_FALSE(intake.is_complete());
    intake.Note(*end.answers);
  });
  const auto offer = [&](std::uint64_t first, Eigen::Index count) {
    core::Status status;
    do {
      status = intake.Offer(stream.get(), Part(first, count));
      std::this_thread::yield();
    } while (status.code == StatusCode::kFailedPrecondition);  // the last is not taken yet
    EXPECT_TRUE(status.ok()) << status.message;
  };
  offer(0, 3);
  offer(3, 6);
  offer(9, 1);
  EXPECT_TRUE(intake.OfferEnd(stream.get(), {Digest(), ""}).ok());
  session.join();
  ASSERT_EQ(stream->ends.size(), 1u);
  EXPECT_TRUE(stream->ends[0].ok());
  EXPECT_EQ(intake.rows(), kPoints);
  EXPECT_TRUE(intake.is_complete());
  EXPECT_FALSE(intake.is_joined());
}

TEST(PointIntake, RefusesWhatDoesNotFollowAndTakesNothingOfIt) {
  PointIntake intake(Request(), std::chrono::seconds(60));
  const auto stream = std::make_shared<Stream>();
  ASSERT_TRUE(intake.Join(stream).ok());
  const auto refusal = [&](PointsPart part) {
    const core::Status status = intake.Offer(stream.get(), std::move(part));
    EXPECT_EQ(status.code, StatusCode::kInvalidArgument);
    return status.message;
  };
  EXPECT_THAT(refusal(Part(1, 2)), HasSubstr("begins with row 1 but row 0 is the next"));
  EXPECT_THAT(refusal(Part(0, kPoints + 1)), HasSubstr("announced 10 points"));
  EXPECT_THAT(refusal(Part(std::numeric_limits<std::uint64_t>::max(), 1)), HasSubstr("announced"));
  PointsPart bad = Part(0, 3);
  bad.points(1, 2) = std::numeric_limits<double>::infinity();
  EXPECT_THAT(refusal(bad), HasSubstr("coordinate 1 of row 2 is inf"));
  const core::Status early = intake.OfferEnd(stream.get(), {Digest(), ""});
  EXPECT_THAT(early.message, HasSubstr("after 0 points"));
  EXPECT_EQ(intake.rows(), 0u);
}

TEST(PointIntake, RefusesTangentsThatAreNotOrthonormal) {
  PointIntake intake(Request(true), std::chrono::seconds(60));
  const auto stream = std::make_shared<Stream>();
  ASSERT_TRUE(intake.Join(stream).ok());
  PointsPart part = Part(0, 2);
  part.tangents = (Eigen::MatrixXd(6, 2) << 1, 1, 0, 0, 0, 0, 1, 1.1, 0, 0, 0, 0).finished();
  EXPECT_THAT(intake.Offer(stream.get(), part).message,
              HasSubstr("tangent basis of row 1 is not orthonormal"));
  part.tangents(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(intake.Offer(stream.get(), part).ok());
  part.tangents(3, 1) = 1;
  EXPECT_TRUE(intake.Offer(stream.get(), part).ok());
}

TEST(PointIntake, ANewStreamGoesOnAndRepeatsWhatItLikes) {
  PointIntake intake(Request(), std::chrono::seconds(60));
  const auto older = std::make_shared<Stream>(), newer = std::make_shared<Stream>();
  ASSERT_TRUE(intake.Join(older).ok());
  ASSERT_TRUE(intake.Offer(older.get(), Part(0, 3)).ok());
  ASSERT_TRUE(intake.Join(newer).ok());
  ASSERT_EQ(older->ends.size(), 1u);
  EXPECT_EQ(older->ends[0].code, StatusCode::kFailedPrecondition);
  EXPECT_TRUE(intake.Offer(older.get(), Part(3, 1)).ok());  // and is not taken
  std::thread session([&] {
    const auto outcome = intake.Ask(Batch(kPoints));
    ASSERT_TRUE(outcome.answers);
    EXPECT_EQ(outcome.answers->blocks[0].points, Part(0, kPoints).points);
  });
  core::Status status;
  do {
    status = intake.Offer(newer.get(), Part(0, kPoints));
    std::this_thread::yield();
  } while (status.code == StatusCode::kFailedPrecondition);  // what the older offered is due
  EXPECT_TRUE(status.ok()) << status.message;
  session.join();
}

// A server was killed after it had recorded the end, and before its client heard of it.
TEST(PointIntake, TheEndMayComeAgainAfterAReplay) {
  PointIntake intake(Request(), std::chrono::seconds(60));
  core::Answers all, end;
  all.blocks.emplace_back().points = Part(0, kPoints).points;
  intake.Note(all);
  intake.Note(end);
  EXPECT_EQ(intake.rows(), kPoints);
  for (const std::uint64_t from : {kPoints, std::uint64_t{4}}) {
    const auto stream = std::make_shared<Stream>();
    ASSERT_TRUE(intake.Join(stream).ok());
    EXPECT_EQ(stream->proceeded, 1);
    if (from < kPoints) {
      EXPECT_TRUE(intake.Offer(stream.get(), Part(from, kPoints - from)).ok());
    }
    const core::Status status = intake.OfferEnd(stream.get(), {Digest(), ""});
    EXPECT_TRUE(status.ok()) << status.message;
    ASSERT_EQ(stream->ends.size(), 1u);
    EXPECT_TRUE(stream->ends[0].ok());
  }
}

TEST(PointIntake, AWrongDigestEndsTheStreamAndNotTheMesh) {
  PointIntake intake(Request(), std::chrono::seconds(60));
  const auto wrong = std::make_shared<Stream>(), right = std::make_shared<Stream>();
  ASSERT_TRUE(intake.Join(wrong).ok());
  ASSERT_TRUE(intake.Offer(wrong.get(), Part(0, kPoints)).ok());
  intake.Note(*intake.Ask(Batch(kPoints)).answers);
  ASSERT_TRUE(intake.OfferEnd(wrong.get(), {"?", ""}).ok());
  std::thread session([&] { EXPECT_TRUE(intake.Ask(Batch(0)).answers); });
  while (intake.is_joined()) std::this_thread::yield();
  ASSERT_TRUE(intake.Join(right).ok());
  ASSERT_TRUE(intake.OfferEnd(right.get(), {Digest(), ""}).ok());
  session.join();
  ASSERT_EQ(wrong->ends.size(), 1u);
  EXPECT_THAT(wrong->ends[0].message, HasSubstr("SHA-256 of the points"));
}

TEST(PointIntake, WaitsForAStreamForSoLong) {
  PointIntake intake(Request(), std::chrono::milliseconds(1));
  const auto outcome = intake.Ask(Batch(kPoints));
  ASSERT_TRUE(outcome.failure);
  EXPECT_EQ(outcome.failure->reason, FailureReason::kNoWorker);
}

TEST(PointIntake, IsOverOnceInterrupted) {
  PointIntake intake(Request(), std::chrono::hours(1));
  std::thread session([&] {
    const auto outcome = intake.Ask(Batch(kPoints));
    EXPECT_FALSE(outcome.answers || outcome.failure);
  });
  intake.Interrupt();
  session.join();
  EXPECT_EQ(intake.Join(std::make_shared<Stream>()).code, StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace stellate::server
