// Sizes that a C++ oracle gives. How meshes are graded by them, and which are refused, is tried in
// python/test_sizes.py.
#include <string>

#include "live.h"
#include "support/spoiled_oracle.h"

namespace stellate::testing {
namespace {

class Sizes : public Live {};

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

TEST_F(Sizes, OfTheWrongCountAreTheOracles) {
  const auto torus = Make("torus:1:0.4");
  MeshOptions options = At(0.3);
  options.size_rate = 0.5;
  for (const int left : {0, 1}) {
    SpoiledOracle oracle(*torus);
    oracle.on_sizes = [left](const auto&, Eigen::VectorXd& sizes) {
      sizes.conservativeResize(left * (sizes.size() - 1));
    };
    const Expected<Mesh> mesh = MeshManifold(oracle, options);
    ASSERT_FALSE(mesh.has_value()) << left;
    EXPECT_EQ(mesh.error().code, ErrorCode::kOracleFailed) << mesh.error().message;
    EXPECT_EQ(mesh.error().reason, "ORACLE_SHAPE") << mesh.error().message;
    EXPECT_NE(mesh.error().message.find("sizes"), std::string::npos) << mesh.error().message;
  }
}

}  // namespace
}  // namespace stellate::testing
