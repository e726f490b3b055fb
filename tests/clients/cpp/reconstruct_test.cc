#include "stellate/reconstruct.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace stellate {
namespace {

TEST(Reconstruct, ScalesTangentsWithTheirPoints) {
  constexpr Eigen::Index kCount = 100;
  Eigen::MatrixXd points(2, kCount), tangents(2, kCount);
  for (Eigen::Index i = 0; i < kCount; ++i) {
    const double t = 2 * std::numbers::pi * static_cast<double>(i) / kCount;
    points.col(i) << std::cos(t), 1000 * std::sin(t);
    tangents.col(i) << -std::sin(t), 1000 * std::cos(t);
    tangents.col(i).normalize();
  }
  ReconstructOptions options;
  options.dimension = 1;
  options.noise = 0.0;
  options.scale = {1, 1000};
  const Expected<Mesh> mesh = Reconstruct(points, options, tangents);
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.text;
  EXPECT_EQ(mesh->points, points);
  EXPECT_NE(mesh->report.certificate.verdict.find("divided by 1, 1000, and"), std::string::npos);

  options.scale = {1, -1};
  EXPECT_EQ(Reconstruct(points, options).error().code, ErrorCode::kRefused);
  options.scale = {1e-308};
  EXPECT_EQ(Reconstruct(points * 1e10, options).error().message, "points / scale are not finite");
}

}  // namespace
}  // namespace stellate
