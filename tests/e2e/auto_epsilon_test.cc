// An epsilon that is found from the oracle's answers, and what follows a mesh that it was too
// coarse for.
#include "live.h"
#include "stellate/implicit.h"

namespace stellate::testing {
namespace {

class AutoEpsilon : public Live {
 protected:
  static MeshOptions Auto() {
    MeshOptions options = At(0);
    options.epsilon = kAuto;
    return options;
  }
};

// Two lobes, of which a neck of .045 is seldom the nearest to anything.
ImplicitOracle Hourglass() {
  const auto f = [](const Eigen::VectorXd& x) {
    const double square = x.squaredNorm();
    return Eigen::VectorXd::Constant(1, square * square - 2 * x[0] * x[0] + square - 0.002);
  };
  const auto slope = [](const Eigen::VectorXd& x) -> Eigen::MatrixXd {
    Eigen::RowVectorXd row = (4 * x.squaredNorm() + 2) * x.transpose();
    row[0] -= 4 * x[0];
    return row;
  };
  const Eigen::VectorXd corner = Eigen::VectorXd::Constant(3, 1.4);
  return {2, 3, f, slope, {-corner, corner}};
}

bool Says(const std::string& text, const std::string& words) {
  return text.find(words) != std::string::npos;
}

TEST_F(AutoEpsilon, GoesOnWithTheReachThatTheCertificateShows) {
  ImplicitOracle hourglass = Hourglass();
  const Expected<ChosenEpsilon> first = ChooseEpsilon(hourglass);
  ASSERT_TRUE(first.has_value()) << first.error().message;
  const Expected<Mesh> coarse = MeshManifold(hourglass, At(first->epsilon));
  ASSERT_TRUE(coarse.has_value()) << coarse.error().message;
  ASSERT_FALSE(coarse->report.certified()) << "a quarter of the reach that was found will do";
  ASSERT_TRUE(coarse->report.finer.has_value());
  EXPECT_LT(coarse->report.finer->epsilon, first->epsilon);

  const Expected<Mesh> mesh = MeshManifold(hourglass, Auto());
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  const Report& report = mesh->report;
  EXPECT_TRUE(report.certified()) << report.certificate.verdict;
  EXPECT_EQ(report.certificate.euler_characteristic, 2);
  EXPECT_EQ(report.epsilon, coarse->report.finer->epsilon);
  EXPECT_EQ(report.epsilon_reason, coarse->report.finer->reason);
  EXPECT_TRUE(Says(report.epsilon_reason, "by the certificate of epsilon 0."))
      << report.epsilon_reason;
  EXPECT_TRUE(Says(report.epsilon_reason, "which was too coarse")) << report.epsilon_reason;
  EXPECT_TRUE(Says(report.text, report.epsilon_reason)) << report.text;

  const Expected<Mesh> given = MeshManifold(hourglass, At(report.epsilon));
  ASSERT_TRUE(given.has_value()) << given.error().message;
  EXPECT_TRUE(AreIdentical(*mesh, *given));
}

TEST_F(AutoEpsilon, IsLeftAloneWhereItWillDo) {
  const auto torus = Make("torus:1:0.4");
  const Expected<Mesh> mesh = MeshManifold(*torus, Auto());
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.certificate.verdict;
  EXPECT_FALSE(mesh->report.finer.has_value());
  EXPECT_NEAR(mesh->report.epsilon, 0.1, 0.005);
  EXPECT_TRUE(Says(mesh->report.epsilon_reason, " queries")) << mesh->report.epsilon_reason;
}

}  // namespace
}  // namespace stellate::testing
