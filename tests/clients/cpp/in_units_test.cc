// Axes of different units: what is meshed in x / scale is handed back in x.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numbers>

#include "stellate/client.h"
#include "stellate/implicit.h"
#include "stellate/oracles.h"
#include "stellate/oracles/combined.h"
#include "stellate/solids.h"

namespace stellate {
namespace {

using ::testing::HasSubstr;

const Eigen::Vector3d kScale(0.01, 500, 1);

ImplicitOracle Ellipsoid(bool with_jacobian) {
  const auto f = [](const Eigen::VectorXd& x) {
    return Eigen::VectorXd::Constant(1, x.cwiseQuotient(kScale).squaredNorm() - 1);
  };
  ImplicitOracle::Jacobian jacobian;
  if (with_jacobian) {
    jacobian = [](const Eigen::VectorXd& x) -> Eigen::MatrixXd {
      return 2 * x.cwiseQuotient(kScale.cwiseAbs2()).transpose();
    };
  }
  return {2, 3, f, jacobian, {-1.3 * kScale, 1.3 * kScale}};
}

MeshOptions With(double epsilon) {
  MeshOptions options;
  options.epsilon = epsilon;
  options.scale = {kScale[0], kScale[1], kScale[2]};
  return options;
}

TEST(InUnits, MeshesEquationsAsTheSphereThatTheyAre) {
  for (const bool with_jacobian : {false, true}) {
    ImplicitOracle ellipsoid = Ellipsoid(with_jacobian);
    const auto mesh = MeshManifold(ellipsoid, With(0.35));
    ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
    const Certificate& certificate = mesh->report.certificate;
    EXPECT_TRUE(mesh->report.certified()) << mesh->report.text;
    EXPECT_EQ(certificate.euler_characteristic, 2);
    EXPECT_LE(certificate.max_circumradius, 0.35);
    EXPECT_NEAR(certificate.volume, 4 * std::numbers::pi, 0.8);
    EXPECT_THAT(certificate.verdict, HasSubstr("divided by 0.01, 500, 1, and lengths"));
    for (Eigen::Index j = 0; j < mesh->points.cols(); ++j)
      EXPECT_NEAR(mesh->points.col(j).cwiseQuotient(kScale).norm(), 1, 1e-9);
  }
}

TEST(InUnits, KeepsEdgesAndNamesOfMaterials) {
  const Eigen::Vector3d half(0, 500, 1);
  solids::Labels layers(
      {{"left", solids::Box(-kScale, half)},
       {"right", solids::Box(-kScale.cwiseProduct(Eigen::Vector3d(0, 1, 1)), kScale)}});
  const auto mesh = MeshManifold(layers, With(0.7));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.text;
  EXPECT_EQ(mesh->region_names, (std::vector<std::string>{"left", "right"}));
  EXPECT_NEAR(mesh->report.certificate.volume, 8, 1e-9);  // of x / scale
  EXPECT_TRUE(mesh->points.rowwise().maxCoeff().isApprox(kScale, 1e-12));
}

TEST(InUnits, DividesChartsAndTheirDerivatives) {
  const double turn = 2 * std::numbers::pi;
  const auto ring = std::make_shared<oracles::Parametrized>(
      oracles::Chart{[](const Eigen::VectorXd& u) -> Eigen::VectorXd {
                       return Eigen::Vector2d(0.01 * std::cos(u[0]), 500 * std::sin(u[0]));
                     },
                     [](const Eigen::VectorXd& u) -> Eigen::MatrixXd {
                       return Eigen::Vector2d(-0.01 * std::sin(u[0]), 500 * std::cos(u[0]));
                     },
                     Eigen::VectorXd::Zero(1),
                     Eigen::VectorXd::Constant(1, turn),
                     {true}});
  oracles::InUnits scaled(ring, kScale.head(2));
  const Answer near = scaled.ClosestPoint(Eigen::Vector2d(3, 4));
  EXPECT_TRUE(near.points.isApprox(Eigen::Vector2d(0.6, 0.8), 1e-9)) << near.points;
  EXPECT_EQ(scaled.coordinate_scale(), kScale.head(2));
}

TEST(InUnits, NamesPlacesInOwnCoordinatesWhereTheOracleRefuses) {
  const auto f = [](const Eigen::VectorXd& x) {
    const Eigen::VectorXd y = x.cwiseQuotient(kScale);
    return Eigen::VectorXd::Constant(1, y[2] - std::sqrt(1 - y[0] * y[0] - y[1] * y[1]));
  };
  ImplicitOracle cap(2, 3, f, {}, {-kScale, kScale});
  std::string words;
  try {
    (void)MeshManifold(cap, With(0.2));
  } catch (const OracleError& error) {
    words = error.what();
  }
  const size_t from = words.find("near [");
  ASSERT_NE(from, std::string::npos) << words;
  Eigen::Vector3d near;
  ASSERT_EQ(std::sscanf(words.c_str() + from, "near [%lf, %lf, %lf]", &near[0], &near[1], &near[2]),
            3)
      << words;
  EXPECT_NEAR(near.cwiseQuotient(kScale).head(2).norm(), 1, 0.05) << words;
}

TEST(InUnits, TakesOneUnitOfAnyOracleAndRefusesTheRest) {
  const std::shared_ptr<Oracle> torus = MakeManifold("torus:1:0.4").value();
  oracles::InUnits twice(torus, Eigen::VectorXd::Constant(1, 2));
  EXPECT_TRUE(
      twice.ClosestPoint(Eigen::Vector3d(9, 0, 0)).points.isApprox(Eigen::Vector3d(0.7, 0, 0)));
  const auto why = [&](const Eigen::VectorXd& scale) -> std::string {
    try {
      oracles::InUnits(torus, scale);
    } catch (const std::invalid_argument& refusal) {
      return refusal.what();
    }
    return "";
  };
  EXPECT_THAT(why(kScale), HasSubstr("nearest in its own coordinates"));
  EXPECT_THAT(why(Eigen::Vector2d(1, 1)), HasSubstr("3 positive numbers"));
  EXPECT_THAT(why(Eigen::Vector3d(1, 0, 1)), HasSubstr("3 positive numbers"));
  MeshOptions options = With(0.2);
  EXPECT_EQ(MeshManifold(*torus, options).error().code, ErrorCode::kRefused);
}

}  // namespace
}  // namespace stellate
