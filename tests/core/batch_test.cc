#include "core/batch.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/base/infinity.h"
#include "tests/core/support/nan.h"

namespace stellate::core {
namespace {

using testing::kNaN;

// Surfaces in R^3 at a given scale, `far` away from the origin. Flats are vertical lines.
class CheckAnswersTest : public ::testing::TestWithParam<double> {
 protected:
  CheckAnswersTest() {
    spec_.dimension = 2;
    spec_.ambient_dimension = 3;
    spec_.epsilon = scale();
    closest_.kind = QueryKind::kClosestPoint;
    closest_.points = Eigen::MatrixXd::Random(3, 4) * scale();
    flats_.kind = QueryKind::kIntersectFlat;
    flats_.points = Eigen::MatrixXd::Random(3, 4) * scale();
    flats_.bases.resize(6, 4);
    for (int j = 0; j < 4; ++j) flats_.bases.col(j) << 1, 0, 0, 1, 0, 0;
    flats_.radii = Eigen::VectorXd::Constant(4, scale());
    // Up the line by half the radius.
    on_flat_.points = flats_.points;
    on_flat_.points.row(2).array() += 0.5 * scale();
  }

  double scale() const { return GetParam(); }
  StatusCode Check(const QueryBlock& block, const AnswerBlock& answer, int first = 0) {
    const Status status = CheckAnswers(spec_, block, first, answer);
    message_ = status.message;
    return status.code;
  }
  bool Says(const std::string& words) const { return message_.find(words) != std::string::npos; }

  Specification spec_;
  QueryBlock closest_, flats_;
  AnswerBlock on_flat_;
  std::string message_;
};

TEST_P(CheckAnswersTest, AcceptsGoodAnswers) {
  AnswerBlock answer;
  answer.points = closest_.points;
  EXPECT_EQ(Check(closest_, answer), StatusCode::kOk) << message_;
  EXPECT_EQ(Check(flats_, on_flat_), StatusCode::kOk) << message_;
  answer.found = {1, 0, 1, 0};
  answer.points.col(1).setConstant(kNaN);
  EXPECT_EQ(Check(closest_, answer), StatusCode::kOk) << message_;
  EXPECT_EQ(Check(closest_, AnswerBlock{}), StatusCode::kOk) << message_;
}

TEST_P(CheckAnswersTest, AcceptsAChunkOfABlock) {
  AnswerBlock chunk;
  chunk.points = on_flat_.points.rightCols(2);
  EXPECT_EQ(Check(flats_, chunk, 2), StatusCode::kOk) << message_;
  EXPECT_EQ(Check(flats_, chunk, 3), StatusCode::kOracleShape);
  EXPECT_EQ(Check(flats_, chunk, -1), StatusCode::kOracleShape);
}

TEST_P(CheckAnswersTest, RefusesWrongSizes) {
  AnswerBlock answer;
  answer.points = Eigen::MatrixXd::Zero(3, 5);
  EXPECT_EQ(Check(closest_, answer), StatusCode::kOracleShape);
  EXPECT_TRUE(Says("5 points")) << message_;
  answer.points = Eigen::MatrixXd::Zero(2, 4);
  EXPECT_EQ(Check(closest_, answer), StatusCode::kOracleShape);
  EXPECT_TRUE(Says("2 coordinates")) << message_;
  answer.points = Eigen::MatrixXd::Zero(3, 4);
  answer.found = {1, 1};
  EXPECT_EQ(Check(closest_, answer), StatusCode::kOracleShape);
  EXPECT_TRUE(Says("2 flags")) << message_;
  answer.found.clear();
  answer.tangents = Eigen::MatrixXd::Zero(3, 4);
  EXPECT_EQ(Check(closest_, answer), StatusCode::kOracleShape);
  EXPECT_TRUE(Says("12 numbers")) << message_;
}

TEST_P(CheckAnswersTest, WantsTheTangentsItAskedForUnlessNothingWasFound) {
  closest_.want.tangents = true;
  AnswerBlock answer;
  answer.points = closest_.points;
  EXPECT_EQ(Check(closest_, answer), StatusCode::kOracleShape);
  EXPECT_TRUE(Says("tangent")) << message_;
  answer.found = {0, 0, 0, 0};
  EXPECT_EQ(Check(closest_, answer), StatusCode::kOk) << message_;
}

TEST_P(CheckAnswersTest, RefusesWhatIsNotFinite) {
  for (const double bad : {kNaN, kInfinity, -kInfinity, 1e200}) {
    AnswerBlock answer;
    answer.points = closest_.points;
    answer.points(1, 3) = bad;
    EXPECT_EQ(Check(closest_, answer), StatusCode::kOracleNotFinite) << bad;
    EXPECT_TRUE(Says("query 3") && Says("coordinate 1")) << message_;
  }
}

TEST_P(CheckAnswersTest, NamesTheQueryByItsPlaceInTheBlock) {
  AnswerBlock chunk;
  chunk.points = on_flat_.points.rightCols(2);
  chunk.points(0, 1) = kNaN;
  EXPECT_EQ(Check(flats_, chunk, 2), StatusCode::kOracleNotFinite);
  EXPECT_TRUE(Says("intersect_flat query 3")) << message_;
}

TEST_P(CheckAnswersTest, RefusesPointsOffTheFlatBeyondSolverTolerance) {
  on_flat_.points(0, 1) += 0.5 * kFlatTolerance * scale();
  EXPECT_EQ(Check(flats_, on_flat_), StatusCode::kOk) << message_;
  on_flat_.points(0, 1) += 2 * kFlatTolerance * scale();
  EXPECT_EQ(Check(flats_, on_flat_), StatusCode::kOracleOffFlat);
  EXPECT_TRUE(Says("query 1")) << message_;
}

TEST_P(CheckAnswersTest, RefusesPointsBeyondTheRadius) {
  on_flat_.points(2, 2) = flats_.points(2, 2) - scale();
  EXPECT_EQ(Check(flats_, on_flat_), StatusCode::kOk) << message_;
  on_flat_.points(2, 2) = flats_.points(2, 2) - 1.001 * scale();
  EXPECT_EQ(Check(flats_, on_flat_), StatusCode::kOracleOutsideRadius);
  EXPECT_TRUE(Says("query 2")) << message_;
  flats_.radii[2] = kInfinity;
  EXPECT_EQ(Check(flats_, on_flat_), StatusCode::kOk) << message_;
}

TEST_P(CheckAnswersTest, ForgivesRoundingFarFromTheOrigin) {
  flats_.points.array() += 1e8 * scale();
  on_flat_.points = flats_.points;
  on_flat_.points.row(0).array() += 2e-8 * scale();  // one unit in the last place
  flats_.radii.setConstant(1e-3 * scale());
  EXPECT_EQ(Check(flats_, on_flat_), StatusCode::kOk) << message_;
}

TEST_P(CheckAnswersTest, RefusesTangentsThatAreNotOrthonormal) {
  AnswerBlock answer;
  answer.points = closest_.points;
  answer.tangents = flats_.bases;
  answer.tangents.col(0) << std::cos(1), -std::sin(1), std::sin(1), std::cos(1), 0, 0;
  EXPECT_EQ(Check(closest_, answer), StatusCode::kOk) << message_;

  AnswerBlock longer = answer;
  longer.tangents.col(2) *= 1.00001;
  EXPECT_EQ(Check(closest_, longer), StatusCode::kOracleBadTangent);
  EXPECT_TRUE(Says("query 2")) << message_;

  AnswerBlock skew = answer;
  skew.tangents.col(1) << 1, 0.6, 0, 0.8, 0, 0;
  EXPECT_EQ(Check(closest_, skew), StatusCode::kOracleBadTangent);
  EXPECT_TRUE(Says("vectors 0 and 1") && Says("0.6")) << message_;

  // n x k x d in place of n x d x k: the mistake that clients make.
  AnswerBlock transposed = answer;
  transposed.tangents.col(3) << 1, 0, 0, 0, 1, 0;
  EXPECT_EQ(Check(closest_, transposed), StatusCode::kOracleBadTangent);

  AnswerBlock unset = answer;
  unset.tangents.col(0).setConstant(kNaN);
  EXPECT_EQ(Check(closest_, unset), StatusCode::kOracleNotFinite);
  unset.found = {0, 1, 1, 1};
  EXPECT_EQ(Check(closest_, unset), StatusCode::kOk) << message_;
}

TEST_P(CheckAnswersTest, RefusesSizesThatAreNone) {
  AnswerBlock answer;
  answer.points = closest_.points;
  answer.sizes = Eigen::VectorXd::Constant(4, scale());
  EXPECT_EQ(Check(closest_, answer), StatusCode::kOk) << "not wanted, but right";
  closest_.want.sizes = true;
  EXPECT_EQ(Check(closest_, answer), StatusCode::kOk) << message_;

  AnswerBlock bad = answer;
  bad.sizes[2] = 0;
  EXPECT_EQ(Check(closest_, bad), StatusCode::kOracleBadSize);
  EXPECT_TRUE(Says("query 2") && Says("size")) << message_;
  bad.sizes[2] = -scale();
  EXPECT_EQ(Check(closest_, bad), StatusCode::kOracleBadSize);
  for (const double value : {kNaN, kInfinity, -kInfinity, 1e300}) {
    bad.sizes[2] = value;
    EXPECT_EQ(Check(closest_, bad), StatusCode::kOracleNotFinite) << value;
  }
  bad.found = {1, 1, 0, 1};
  EXPECT_EQ(Check(closest_, bad), StatusCode::kOk) << message_;

  AnswerBlock few = answer;
  few.sizes.conservativeResize(3);
  EXPECT_EQ(Check(closest_, few), StatusCode::kOracleShape);
  EXPECT_TRUE(Says("3 numbers for 4 points")) << message_;
  few.sizes.resize(0);
  EXPECT_EQ(Check(closest_, few), StatusCode::kOracleShape);
  EXPECT_TRUE(Says("local_size")) << message_;
  few.found = {0, 0, 0, 0};
  EXPECT_EQ(Check(closest_, few), StatusCode::kOk) << message_;
}

INSTANTIATE_TEST_SUITE_P(Scales, CheckAnswersTest, ::testing::Values(1e-6, 1.0, 1e6));

}  // namespace
}  // namespace stellate::core
