#include "core/run/dimension_probe.h"

#include <gtest/gtest.h>

#include <string>
#include <tuple>
#include <utility>

#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::Make;
using testing::SpecificationFor;

bool Mentions(const std::string& text, const std::string& words) {
  return text.find(words) != std::string::npos;
}

// A manifold that is declared with another dimension than it has, by closest points alone.
Certificate CertificateOf(const std::string& manifold, int declared, double epsilon) {
  const auto oracle = Make(manifold);
  Specification spec = SpecificationFor(*oracle, epsilon);
  spec.oracle = {};
  spec.dimension = declared;
  spec.limits.max_vertices = 3000;
  return Drive(spec, *oracle).report().certificate;
}

class OtherDimensions
    : public ::testing::TestWithParam<std::tuple<std::string, int, double, std::string>> {};

TEST_P(OtherDimensions, AreNamedAndNoEpsilonIsPromised) {
  const auto& [manifold, declared, epsilon, has] = GetParam();
  const Certificate certificate = CertificateOf(manifold, declared, epsilon);
  EXPECT_FALSE(certificate.certified);
  EXPECT_TRUE(Mentions(certificate.verdict, "the manifold has dimension " + has + " near (") &&
              Mentions(certificate.verdict, "no epsilon will do. Correct the dimension"))
      << certificate.verdict;
  EXPECT_FALSE(Mentions(certificate.verdict, "smaller epsilon") ||
               Mentions(certificate.verdict, "allow more vertices"))
      << certificate.verdict;
  for (const std::string& warning : certificate.warnings)
    EXPECT_FALSE(Mentions(warning, "take epsilon")) << warning;
}

INSTANTIATE_TEST_SUITE_P(Manifolds, OtherDimensions,
                         ::testing::Values(std::tuple{"torus", 1, 0.3, "2"},
                                           std::tuple{"torus", 1, 0.1, "2"},
                                           std::tuple{"sphere:2", 1, 0.3, "2"},
                                           std::tuple{"so3", 2, 0.5, "3"},
                                           std::tuple{"flat-torus:3", 2, 0.5, "3"}));

TEST(OtherDimension, IsNamedWhereNoSeedHasSoManyDirections) {
  for (const auto& [manifold, declared] : {std::pair{"torus-knot:2:9", 2}, {"flat-torus:2", 3}}) {
    const std::string verdict = CertificateOf(manifold, declared, 0.3).verdict;
    EXPECT_TRUE(Mentions(verdict, "points of the manifold were found, the first (") &&
                Mentions(verdict, "but at none of them does it look " + std::to_string(declared) +
                                      "-dimensional"))
        << verdict;
  }
}

// It bends, comes near to itself, or is far too fine a thing for epsilon, but its dimension is
// right.
TEST(DimensionProbe, AccusesNoDimensionThatIsRight) {
  for (const auto& [manifold, epsilon] : {std::pair{"torus-knot:2:9", 0.5},
                                          {"torus-knot:2:9", 1.0},
                                          {"torus:1:0.02", 0.3},
                                          {"torus:1:0.02", 1.0},
                                          {"ellipsoid:1:1:0.02", 0.3},
                                          {"so3", 1.5}}) {
    const auto oracle = Make(manifold);
    const Certificate certificate = CertificateOf(manifold, oracle->dimension(), epsilon);
    EXPECT_FALSE(Mentions(certificate.verdict, "the manifold has dimension"))
        << certificate.verdict;
  }
}

}  // namespace
}  // namespace stellate::core
