#include "server/oracles/cross_check.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/server/support/sphere.h"

namespace stellate::server {
namespace {

using core::AnswerBlock;
using core::QueryBlock;

// Queries about the unit sphere in R^3, mesh size 0.1: 0.001 is allowed.
class CrossCheckTest : public ::testing::Test {
 protected:
  static AnswerBlock Found(double x, double y, double z) {
    AnswerBlock answer;
    answer.points = Eigen::Vector3d(x, y, z);
    answer.found = {1};
    return answer;
  }
  static AnswerBlock NotFound() {
    AnswerBlock answer = Found(0, 0, 0);
    answer.found = {0};
    return answer;
  }

  std::string Compare(const QueryBlock& block, const AnswerBlock& a, const AnswerBlock& b) {
    const std::string words = FindDisagreement(spec_, block, 0, {"east", &a, 0}, {"west", &b, 0});
    EXPECT_EQ(FindDisagreement(spec_, block, 0, {"west", &b, 0}, {"east", &a, 0}).empty(),
              words.empty())
        << "neither comes first";
    return words;
  }

  static QueryBlock ClosestPoint(double x, double y, double z) {
    QueryBlock block;
    block.points = Eigen::Vector3d(x, y, z);
    return block;
  }
  // The line through c along the third axis.
  static QueryBlock Flat(double x, double y, double z, double radius) {
    QueryBlock block = ClosestPoint(x, y, z);
    block.kind = core::QueryKind::kIntersectFlat;
    block.bases = Eigen::MatrixXd::Zero(6, 1);
    block.bases(0, 0) = block.bases(3, 0) = 1;
    block.radii = Eigen::VectorXd::Constant(1, radius);
    return block;
  }

  const core::Specification spec_ = testing::SphereSpec(0.1);
};

TEST_F(CrossCheckTest, EqualAnswersAgree) {
  EXPECT_EQ(Compare(ClosestPoint(0, 0, 2), Found(0, 0, 1), Found(0, 0, 1)), "");
  EXPECT_EQ(Compare(Flat(0, 0, 0.9, 1), Found(0, 0, 1), Found(0, 0, 1)), "");
}

TEST_F(CrossCheckTest, SolversMayBeAsFarApartAsTheToleranceSays) {
  EXPECT_EQ(Compare(ClosestPoint(0, 0, 2), Found(0, 0, 1), Found(0, 0, 1.0009)), "");
  EXPECT_NE(Compare(ClosestPoint(0, 0, 2), Found(0, 0, 1), Found(0, 0, 1.0011)), "");
  EXPECT_EQ(Compare(Flat(0, 0, 0.9, 1), Found(0, 0, 1), Found(0, 0, 1.0009)), "");
  EXPECT_NE(Compare(Flat(0, 0, 0.9, 1), Found(0, 0, 1), Found(0, 0, 1.0011)), "");
}

TEST_F(CrossCheckTest, OnTheMedialAxisAnyOfTheNearestWillDo) {
  EXPECT_EQ(Compare(ClosestPoint(0, 0, 0), Found(0, 0, 1), Found(1, 0, 0)), "");
  EXPECT_NE(Compare(ClosestPoint(0, 0, 0.01), Found(0, 0, 1), Found(0, 0, -1)), "");
}

TEST_F(CrossCheckTest, AnIntersectionIsOnePoint) {
  EXPECT_NE(Compare(Flat(0, 0, 0, 2), Found(0, 0, 1), Found(0, 0, -1)), "");
}

TEST_F(CrossCheckTest, NotFoundContradictsAnIntersectionWellInside) {
  EXPECT_EQ(Compare(ClosestPoint(0, 0, 2), NotFound(), Found(0, 0, 1)), "");
  EXPECT_EQ(Compare(Flat(0, 0, 0.9, 0.11), NotFound(), Found(0, 0, 1)), "") << "near the rim";
  EXPECT_EQ(Compare(Flat(0, 0, 0.9, 0.11), NotFound(), NotFound()), "");
  EXPECT_NE(Compare(Flat(0, 0, 0.9, 1), NotFound(), Found(0, 0, 1)), "");
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_NE(Compare(Flat(0, 0, 0.9, infinity), NotFound(), Found(0, 0, 1)), "");
}

TEST_F(CrossCheckTest, TangentSpacesAreComparedAndNotTheirBases) {
  AnswerBlock a = Found(0, 0, 1), b = Found(0, 0, 1);
  a.tangents.resize(6, 1);
  a.tangents << 1, 0, 0, 1, 0, 0;  // (1, 0, 0) and (0, 1, 0), coordinate by coordinate
  b.tangents.resize(6, 1);
  b.tangents << 0.6, -0.8, 0.8, 0.6, 0, 0;  // turned within the plane
  EXPECT_EQ(Compare(ClosestPoint(0, 0, 2), a, b), "");
  b.tangents << 1, 0, 0, 0.8, 0, 0.6;  // out of it
  EXPECT_NE(Compare(ClosestPoint(0, 0, 2), a, b).find("tangent spaces"), std::string::npos);
  b.points.col(0) << 1, 0, 0;
  EXPECT_EQ(Compare(ClosestPoint(0, 0, 0), a, b), "") << "other points, other tangents";
}

TEST_F(CrossCheckTest, SizesOfOnePointAgreeToATenth) {
  AnswerBlock a = Found(0, 0, 1), b = Found(0, 0, 1);
  a.sizes = Eigen::VectorXd::Constant(1, 1.0);
  b.sizes = Eigen::VectorXd::Constant(1, 0.901);
  EXPECT_EQ(Compare(ClosestPoint(0, 0, 2), a, b), "");
  b.sizes[0] = 0.899;
  EXPECT_NE(Compare(ClosestPoint(0, 0, 2), a, b).find("sizes there are 1 and 0.899"),
            std::string::npos);
  b.points.col(0) << 1, 0, 0;
  EXPECT_EQ(Compare(ClosestPoint(0, 0, 0), a, b), "") << "other points, other sizes";
}

TEST_F(CrossCheckTest, RoundingFarFromTheOriginIsForgiven) {
  const double far = 1e12;  // where doubles are 1e-4 apart
  EXPECT_EQ(Compare(Flat(far, 0, 0, 1), Found(far, 0, 0.5), Found(far, 0, 0.5 + 0.1)), "");
}

TEST_F(CrossCheckTest, TheMessageNamesEverything) {
  EXPECT_EQ(Compare(ClosestPoint(0, 0, 2), Found(0, 0, 1), Found(0, 0, 0.5)),
            "closest_point query 0 at (0, 0, 2): east answered (0, 0, 1), 1 away, and west "
            "answered (0, 0, 0.5), 1.5 away; the distances differ by 0.5, more than the 0.001 "
            "(0.01 epsilon) allowed: serve one manifold by all workers");
  EXPECT_EQ(Compare(Flat(0, 0, 0.9, 1), NotFound(), Found(0, 0, 1)),
            "intersect_flat query 0 at (0, 0, 0.9): east answered \"not found\", and west answered "
            "(0, 0, 1), 0.1 away; an intersection well inside the radius, 1, is found by all: "
            "serve one manifold by all workers");
}

}  // namespace
}  // namespace stellate::server
