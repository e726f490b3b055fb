// What speaks for and against a declared reach: tangent spaces have no part in distances, and given
// ones that are a little wrong prove nothing either way.

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/certificate/certifier.h"
#include "tests/core/certificate/handmade_meshes.h"
#include "tests/core/support/says.h"

namespace stellate::core {
namespace {

using testing::Says;

// n points of the unit circle, their tangents turned by wrong * cos(7 angle).
HandmadeMesh Circle(int n, double wrong = 0) {
  return TorusGrid(1, n, [wrong](const Eigen::VectorXd& angle) {
    const double turned = angle[0] + wrong * std::cos(7 * angle[0]);
    return std::pair<Eigen::VectorXd, Eigen::MatrixXd>(
        Eigen::Vector2d(std::cos(angle[0]), std::sin(angle[0])),
        Eigen::Vector2d(-std::sin(turned), std::cos(turned)));
  });
}

Certificate CertifyCircle(int n, double declared, double wrong) {
  const HandmadeMesh mesh = Circle(n, wrong);
  Specification spec = SpecificationFor(mesh, 1.001 * std::sin(std::numbers::pi / n));
  spec.declared_reach = declared;
  spec.oracle.tangent_basis = true;
  return Certify(spec, mesh, ClosestOnSphere, {0, 0, true},
                 [wrong](const Eigen::VectorXd& y) -> Eigen::MatrixXd {
                   const double angle = std::atan2(y[1], y[0]);
                   const double turned = angle + wrong * std::cos(7 * angle);
                   return Eigen::Vector2d(-std::sin(turned), std::cos(turned));
                 })
      .certificate;
}

TEST(DeclaredReachClaims, TangentsByDifferencesExcuseNoDistance) {
  for (const int n : {12, 24, 48}) {
    const HandmadeMesh mesh = Circle(n);
    const double size = std::sin(std::numbers::pi / n);
    for (const double times : {1.1, 1.2, 1.3}) {
      Specification spec = SpecificationFor(mesh, 1.001 * size);
      spec.declared_reach = times;
      StarFacts facts{0, 0, true};
      facts.tangent_error_length = size;  // of steps a quarter of the size, say
      const Certificate c = Certify(spec, mesh, ClosestOnSphere, facts).certificate;
      EXPECT_TRUE(c.reach_refuted) << n << ", " << times << ": " << c.verdict;
      EXPECT_TRUE(Says(c.verdict, "a point of simplex")) << c.verdict;
    }
    Specification spec = SpecificationFor(mesh, 1.001 * size);
    spec.declared_reach = 1;
    StarFacts facts{0, 0, true};
    facts.tangent_error_length = size;
    const Certificate c = Certify(spec, mesh, ClosestOnSphere, facts).certificate;
    EXPECT_EQ(c.level, CertificateLevel::kProved) << c.verdict;
  }
}

TEST(DeclaredReachClaims, AnOracleThatMovesItsPointsExcusesAsMuchAsThatAlone) {
  const HandmadeMesh mesh = Circle(24);
  Specification spec = SpecificationFor(mesh, 1.001 * std::sin(std::numbers::pi / 24));
  const auto moving = [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return (1 + 1e-4 * std::sin(1000 * (x[0] + 2 * x[1]))) * x.normalized();
  };
  spec.declared_reach = 1;
  EXPECT_FALSE(Certify(spec, mesh, moving).certificate.reach_refuted);
  spec.declared_reach = 1.3;
  EXPECT_TRUE(Certify(spec, mesh, moving).certificate.reach_refuted);
}

TEST(DeclaredReachClaims, ATrueReachIsNotRefutedByTangentsThatAreALittleWrong) {
  for (const int n : {8, 24}) {
    for (const double wrong : {0.0, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4}) {
      for (const double share : {1.0, 1 - 1e-6, 1 - 1e-4}) {
        const Certificate c = CertifyCircle(n, share, wrong);
        EXPECT_FALSE(c.reach_refuted) << n << ", " << wrong << ", " << share << ": " << c.verdict;
        EXPECT_TRUE(c.certified) << c.verdict;
        if (wrong <= 1e-7) {
          EXPECT_EQ(c.level, CertificateLevel::kProved) << wrong;
        }
        if (c.level == CertificateLevel::kProved) continue;
        ASSERT_FALSE(c.warnings.empty());
        EXPECT_TRUE(Says(c.warnings.front(), "Not proved")) << c.warnings.front();
        EXPECT_TRUE(Says(c.warnings.front(), "unless tangent spaces that the oracle gives are "))
            << c.warnings.front();
      }
    }
  }
  EXPECT_EQ(CertifyCircle(24, 1, 1e-4).level, CertificateLevel::kSampled);
}

TEST(DeclaredReachClaims, ARefutationByTangentsSaysThatTheyMayBeWrong) {
  const Certificate c = CertifyCircle(24, 1, 0.02);
  EXPECT_TRUE(c.reach_refuted) << c.verdict;
  EXPECT_TRUE(Says(c.verdict, "or are tangent spaces that the oracle gives wrong by")) << c.verdict;
}

TEST(DeclaredReachClaims, ARefutedReachIsToldApartFromTheOneThatIsAllowed) {
  const HandmadeMesh mesh = Circle(24);
  Specification spec = SpecificationFor(mesh, 1.001 * std::sin(std::numbers::pi / 24));
  spec.declared_reach = 1 + 1e-5;
  StarFacts facts{0, 0, true};
  facts.tangent_error_length = 0.01;
  const Certificate c = Certify(spec, mesh, ClosestOnSphere, facts).certificate;
  EXPECT_TRUE(c.reach_refuted) << c.verdict;
  EXPECT_TRUE(Says(c.verdict, "at most 1, less by ")) << c.verdict;
}

}  // namespace
}  // namespace stellate::core
