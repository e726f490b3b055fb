#include "core/run/repeat_check.h"

#include <gtest/gtest.h>

namespace stellate::core {
namespace {

constexpr double kEpsilon = 0.1;

// A hundred points on the x-axis, of which each third was not found; sizes 1, 2, ...
AnsweredPoints OnAxis(bool with_sizes) {
  AnsweredPoints answers;
  answers.points = Eigen::MatrixXd::Zero(3, 100);
  for (Eigen::Index i = 0; i < 100; ++i) {
    answers.points(0, i) = static_cast<double>(i);
    answers.found.push_back(i % 3 != 2);
  }
  if (with_sizes) answers.sizes = Eigen::VectorXd::LinSpaced(100, 1, 100);
  return answers;
}

// The answers to a round that asks for the sample again after something else.
Answers Again(const RepeatCheck& check, const AnsweredPoints& first) {
  Answers answers;
  answers.blocks.resize(2);
  answers.blocks[1].points = check.Questions().points;
  if (first.sizes.size() > 0)
    answers.blocks[1].sizes = answers.blocks[1].points.row(0).transpose().array() + 1;
  return answers;
}

TEST(RepeatCheck, AsksForTheFirstPointsThatWereFound) {
  RepeatCheck check(kEpsilon);
  EXPECT_FALSE(check.has_questions());
  EXPECT_TRUE(check.Judge({}).ok());
  check.Sample(OnAxis(false));
  ASSERT_TRUE(check.has_questions());
  const QueryBlock block = check.Questions();
  EXPECT_EQ(block.kind, QueryKind::kClosestPoint);
  EXPECT_FALSE(block.want.sizes);
  EXPECT_EQ(block.size(), 64);
  EXPECT_EQ(block.points(0, 2), 3);
  check.Forget();
  EXPECT_FALSE(check.has_questions());
}

TEST(RepeatCheck, RefusesPointsThatMove) {
  RepeatCheck check(kEpsilon);
  const AnsweredPoints first = OnAxis(false);
  check.Sample(first);
  Answers again = Again(check, first);
  again.blocks[1].points(1, 5) += 0.9e-3 * kEpsilon;
  EXPECT_TRUE(check.Judge(again).ok());
  again.blocks[1].points(1, 7) += 2e-3 * kEpsilon;
  const Status status = check.Judge(again);
  EXPECT_EQ(status.code, StatusCode::kOracleNotIdempotent);
  EXPECT_NE(status.message.find("query 7 of block 1"), std::string::npos) << status.message;
  again.blocks[1].found.assign(64, 1);
  again.blocks[1].found[7] = 0;
  EXPECT_TRUE(check.Judge(again).ok());
}

TEST(RepeatCheck, RefusesSizesThatChange) {
  RepeatCheck check(kEpsilon);
  const AnsweredPoints first = OnAxis(true);
  check.Sample(first);
  EXPECT_TRUE(check.Questions().want.sizes);
  Answers again = Again(check, first);
  EXPECT_TRUE(check.Judge(again).ok());
  again.blocks[1].sizes[3] *= 1.2;
  const Status status = check.Judge(again);
  EXPECT_EQ(status.code, StatusCode::kOracleBadSize);
  EXPECT_NE(status.message.find("query 3 of block 1"), std::string::npos) << status.message;
}

TEST(RepeatCheck, IgnoresSizesThatWereNotAskedFor) {
  RepeatCheck check(kEpsilon);
  check.Sample(OnAxis(false));
  Answers again = Again(check, OnAxis(false));
  again.blocks[1].sizes = Eigen::VectorXd::Ones(64);
  EXPECT_TRUE(check.Judge(again).ok());
}

}  // namespace
}  // namespace stellate::core
