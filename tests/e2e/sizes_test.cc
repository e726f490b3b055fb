// Sizes that the oracle gives, through the real server: graded meshes, and sizes that make no
// sense.
#include <cmath>
#include <functional>
#include <limits>
#include <ostream>
#include <string>

#include "live.h"
#include "support/mesh_judge.h"
#include "support/spoiled_oracle.h"

namespace stellate::testing {
namespace {

class Sizes : public Live {};

// A triangle of circumradius R covers at most 3 sqrt(3) / 4 R^2, and there are two a vertex: so
// many vertices does a surface need at least.
double LeastVertices(double area, double radius) {
  return area / (2 * 0.75 * std::sqrt(3.0) * radius * radius);
}

TEST_F(Sizes, GradeAThinTorus) {
  const auto torus = Make("torus:1:0.9");
  MeshOptions options = At(0.5);
  options.size_rate = 0.4;
  const Expected<Mesh> mesh = MeshManifold(*torus, options);
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.certificate.verdict;
  EXPECT_EQ(mesh->report.certificate.euler_characteristic, 0);
  const double uniform = LeastVertices(4 * M_PI * M_PI * 0.9, 0.4 * *torus->facts().reach);
  EXPECT_LT(10 * static_cast<double>(mesh->points.cols()), uniform);
}

TEST_F(Sizes, GradeALongEllipsoid) {
  const auto ellipsoid = Make("ellipsoid:1:1:10");
  MeshOptions options = At(0.8);
  options.size_rate = 0.4;
  const Expected<Mesh> mesh = MeshManifold(*ellipsoid, options);
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.certificate.verdict;
  EXPECT_EQ(mesh->report.certificate.euler_characteristic, 2);
  const double e = std::sqrt(0.99), area = 2 * M_PI * (1 + 10 / e * std::asin(e));
  const double uniform = LeastVertices(area, 0.4 * *ellipsoid->facts().reach);
  EXPECT_LT(10 * static_cast<double>(mesh->points.cols()), uniform);
}

TEST_F(Sizes, AreTheSameFromAnyNumberOfWorkers) {
  const auto torus = Make("torus:1:0.8");
  MeshOptions options = At(0.5);
  options.size_rate = 0.4;
  const Expected<Mesh> one = MeshManifold(*torus, options);
  options.workers = 3;
  const Expected<Mesh> three = MeshManifold(*torus, options);
  options.speculative = true;
  const Expected<Mesh> ahead = MeshManifold(*torus, options);
  ASSERT_TRUE(one.has_value() && three.has_value() && ahead.has_value());
  EXPECT_TRUE(AreIdentical(*one, *three));
  EXPECT_TRUE(ahead->report.certified()) << ahead->report.certificate.verdict;
  EXPECT_LT(ahead->report.counts.rounds, one->report.counts.rounds);
}

TEST_F(Sizes, MayRideAlongWithTheAnswers) {
  const auto torus = Make("torus:1:0.8");
  MeshOptions options = At(0.5);
  options.size_rate = 0.4;
  const Expected<Mesh> asked = MeshManifold(*torus, options);
  SpoiledOracle rich(*torus);
  rich.on_sizes = [](const auto&, Eigen::VectorXd&) { ADD_FAILURE() << "they came already"; };
  rich.on_closest = [&](const auto&, Answer& a) { a.sizes = torus->LocalSize(a.points); };
  rich.on_flat = [&](const auto&, const auto&, const auto&, Answer& a) {
    a.sizes = torus->LocalSize(a.points);
  };
  const Expected<Mesh> brought = MeshManifold(rich, options);
  ASSERT_TRUE(asked.has_value() && brought.has_value());
  EXPECT_TRUE(AreIdentical(*asked, *brought));
}

struct SizeLie {
  std::string name;
  std::function<void(const Eigen::MatrixXd& points, Eigen::VectorXd& sizes)> spoil;
  std::string reason, mentions;
};
void PrintTo(const SizeLie& c, std::ostream* out) { *out << c.name; }

class LyingSizes : public Live, public ::testing::WithParamInterface<SizeLie> {};

TEST_P(LyingSizes, AreCaught) {
  const auto torus = Make("torus:1:0.4");
  SpoiledOracle oracle(*torus);
  oracle.on_sizes = GetParam().spoil;
  MeshOptions options = At(0.3);
  options.size_rate = 0.5;
  const Expected<Mesh> mesh = MeshManifold(oracle, options);
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kOracleFailed) << mesh.error().message;
  EXPECT_EQ(mesh.error().reason, GetParam().reason) << mesh.error().message;
  EXPECT_NE(mesh.error().message.find(GetParam().mentions), std::string::npos)
      << mesh.error().message;
  oracle.on_sizes = nullptr;
  EXPECT_TRUE(MeshManifold(oracle, options).has_value()) << "the server lives on";
}

SizeLie Everywhere(const std::string& name, double size, const std::string& reason) {
  return {name, [size](const auto&, Eigen::VectorXd& sizes) { sizes.setConstant(size); }, reason,
          "size"};
}

INSTANTIATE_TEST_SUITE_P(
    Each, LyingSizes,
    ::testing::Values(
        Everywhere("nan", std::numeric_limits<double>::quiet_NaN(), "ORACLE_NOT_FINITE"),
        Everywhere("infinite", std::numeric_limits<double>::infinity(), "ORACLE_NOT_FINITE"),
        Everywhere("zero", 0, "ORACLE_BAD_SIZE"), Everywhere("negative", -1, "ORACLE_BAD_SIZE"),
        SizeLie{
            "too_few",
            [](const auto&, Eigen::VectorXd& sizes) { sizes.conservativeResize(sizes.size() - 1); },
            "ORACLE_SHAPE", "sizes"},
        SizeLie{"none", [](const auto&, Eigen::VectorXd& sizes) { sizes.resize(0); },
                "ORACLE_SHAPE", "sizes"},
        SizeLie{"another_each_time",
                [calls = 0](const auto&, Eigen::VectorXd& sizes) mutable { sizes *= ++calls; },
                "ORACLE_BAD_SIZE", "point alone"}),
    [](const auto& lie) { return lie.param.name; });

}  // namespace
}  // namespace stellate::testing
