// Clouds of points: how far their neighbours reach, by density and by noise.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <thread>

#include "stellate/catalogue.h"
#include "stellate/oracles/combined.h"
#include "stellate/oracles/equations.h"
#include "stellate/oracles/points.h"
#include "stellate/oracles/walls.h"

namespace stellate::oracles {
namespace {

using ::testing::HasSubstr;

std::unique_ptr<Manifold> Scanned() { return MakeManifold("torus:1:0.4").value(); }

// At random places of a torus, closer together towards one of its meridians.
Eigen::MatrixXd ScanOf(int count, double noise, double crowding = 1) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> share(0, 1);
  std::normal_distribution<double> normal(0, 1);
  Eigen::MatrixXd points(3, count);
  for (int j = 0; j < count; ++j) {
    const double u = 2 * std::numbers::pi * std::pow(share(random), crowding);
    const double v = 2 * std::numbers::pi * share(random);
    const double ring = 1 + 0.4 * std::cos(v);
    points.col(j) << ring * std::cos(u), ring * std::sin(u), 0.4 * std::sin(v);
    for (int i = 0; i < 3; ++i) points(i, j) += noise * normal(random);
  }
  return points;
}

struct Errors {
  double off = 0;     // of the cloud's points, from the torus
  double turned = 0;  // degrees, of its tangents
};

Errors ErrorsOf(PointCloud& cloud) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> number(-1.4, 1.4);
  Eigen::MatrixXd x(3, 60);
  for (double& coordinate : x.reshaped()) coordinate = number(random);
  x.row(2) *= 0.3;
  const Answer answer = cloud.ClosestPoint(x);
  const Eigen::MatrixXd near = Scanned()->ClosestPoint(answer.points).points;
  const Eigen::MatrixXd ours = cloud.TangentBasis(answer.points),
                        theirs = Scanned()->TangentBasis(near);
  using Basis = Eigen::Map<const Eigen::Matrix<double, 3, 2, Eigen::RowMajor>>;
  Errors errors;
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    EXPECT_TRUE(answer.IsFound(j));
    errors.off = std::max(errors.off, (answer.points.col(j) - near.col(j)).norm());
    const Eigen::Matrix2d turn =
        Basis(ours.col(j).data()).transpose() * Basis(theirs.col(j).data());
    const double cosine = Eigen::JacobiSVD<Eigen::Matrix2d>(turn).singularValues()[1];
    errors.turned =
        std::max(errors.turned, std::acos(std::min(1.0, cosine)) * 180 / std::numbers::pi);
  }
  return errors;
}

double ShareOf(const PointCloud& cloud, double share) {
  std::vector<double> widths(cloud.bandwidths().begin(), cloud.bandwidths().end());
  std::sort(widths.begin(), widths.end());
  return widths[static_cast<size_t>(share * static_cast<double>(widths.size() - 1))];
}

TEST(PointCloud, MorePointsOfOneScanAreNoWorse) {
  PointCloud few(ScanOf(8000, 0.003), 2), many(ScanOf(80000, 0.003), 2);
  const Errors of_few = ErrorsOf(few), of_many = ErrorsOf(many);
  EXPECT_LT(of_many.off, of_few.off);
  EXPECT_LT(of_many.off, 0.003);
  EXPECT_LT(of_many.turned, of_few.turned);
  EXPECT_LT(of_many.turned, 3);
  EXPECT_GT(few.bandwidths().minCoeff(), 0.9 * few.bandwidth()) << "noise is alike everywhere";
  // As far as the noise takes, five times as far as twice the seventh neighbour.
  EXPECT_GT(many.bandwidth(), 5 * std::sqrt(15.8 / 80000));
}

TEST(PointCloud, OfUnevenPointsReachesAsFarAsThese) {
  PointCloud cloud(ScanOf(8000, 0, 3), 2);
  EXPECT_GT(ShareOf(cloud, 0.98), 4 * ShareOf(cloud, 0.02));
  const Errors errors = ErrorsOf(cloud);
  EXPECT_LT(errors.off, 0.01);
  EXPECT_LT(errors.turned, 5);
}

TEST(PointCloud, GivesAllPointsABandwidthThatIsGiven) {
  PointCloud cloud(ScanOf(4000, 0.003), 2, 0.25);
  EXPECT_EQ(cloud.bandwidth(), 0.25);
  EXPECT_TRUE((cloud.bandwidths().array() == 0.25).all());
}

TEST(PointCloud, TellsTheNoiseThatItSmoothes) {
  PointCloud cloud(ScanOf(6000, 0.01), 2, 0.3);
  EXPECT_GT(cloud.residual(), 0.008);
  EXPECT_LT(cloud.residual(), 0.03);
  EXPECT_LT(ErrorsOf(cloud).off, 0.02);
}

TEST(PointCloud, TakesPointsThatComeSeveralTimesForOne) {
  const Eigen::MatrixXd points = ScanOf(4000, 0.003);
  Eigen::MatrixXd again(3, 4000 + 1000 + 120);
  again << points, points.leftCols(1000), points.leftCols(3).replicate(1, 40);
  PointCloud cloud(again, 2), once(points, 2);
  EXPECT_GT(cloud.bandwidths().minCoeff(), 0.7 * once.bandwidths().minCoeff());
  const Errors errors = ErrorsOf(cloud);
  EXPECT_LT(errors.off, 0.01);
  EXPECT_LT(errors.turned, 5);
  try {
    PointCloud(points.leftCols(7).replicate(1, 40), 2);
    FAIL() << "it was taken";
  } catch (const std::invalid_argument& e) {
    EXPECT_THAT(e.what(), HasSubstr("7 different points are too few"));
  }
}

TEST(PointCloud, SaysHowFarItsNeighboursReach) {
  const std::string given = PointCloud(ScanOf(4000, 0.003), 2, 0.25).about();
  EXPECT_THAT(given, HasSubstr("4000 points of R^3, dimension 2, bandwidth 0.25, residual 0.00"));
  const auto uneven = std::make_shared<PointCloud>(ScanOf(4000, 0, 3), 2);
  const std::string local = uneven->about();
  EXPECT_THAT(local,
              ::testing::MatchesRegex(".*bandwidth 0\\.[0-9]+ \\(0\\.[0-9]+ to 0\\.[0-9]+\\).*"));
  EXPECT_EQ(Clipped(uneven, {Ball(Eigen::Vector3d::UnitX(), 0.5)}).about(), local);
}

// As scans in coordinates of a map do, where rounding is coarser than what is converged to.
TEST(PointCloud, MayLieFarFromTheOrigin) {
  const Eigen::Vector3d away(5e5, 5e6, 100);
  const Eigen::MatrixXd points = 25 * ScanOf(4000, 0);
  const Eigen::MatrixXd x = points.leftCols(200).array() + 0.5;
  PointCloud here(points, 2), there(points.colwise() + away, 2);
  const Answer near = here.ClosestPoint(x), far = there.ClosestPoint(x.colwise() + away);
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    ASSERT_TRUE(near.IsFound(j) && far.IsFound(j)) << j;
    EXPECT_LT((far.points.col(j) - away - near.points.col(j)).norm(), 1e-7);
  }
}

TEST(PointCloud, IsToldOfByWhatIsMadeOfIt) {
  const auto scan = std::make_shared<PointCloud>(ScanOf(1000, 0.003), 2, 0.25);
  const auto other = std::make_shared<PointCloud>(ScanOf(1000, 0.003), 2, 0.3);
  const std::string told = scan->about();
  const std::string both = told + "; " + other->about();
  EXPECT_EQ(Transformed(scan, {}).about(), told);
  const Similarity doubled{{}, 2, {}}, into_space{Eigen::MatrixXd::Identity(3, 2), 1, {}};
  EXPECT_EQ(Transformed(scan, doubled).about(), told + ", scaled by 2");
  EXPECT_EQ(Product({scan, scan, other}).about(), both);
  const std::shared_ptr<Oracle> torus = MakeManifold("torus").value();
  EXPECT_EQ(Product({torus, scan}).about(), told);
  EXPECT_EQ(Transformed(torus, doubled).about(), "");
  const auto height = [](const Eigen::VectorXd& x) { return Eigen::VectorXd(x.tail(1)); };
  EXPECT_EQ(LevelSet(scan, height).about(), told);
  const std::shared_ptr<Oracle> circle = MakeManifold("sphere:1").value();
  const auto rim = std::make_shared<Transformed>(circle, into_space);
  EXPECT_EQ(ManifoldWithBoundary(scan, rim).about(), told);
}

}  // namespace
}  // namespace stellate::oracles
