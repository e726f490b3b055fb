// Check and ChooseEpsilon: a server examines an oracle of this process.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <memory>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>

#include "live.h"
#include "stellate/implicit.h"
#include "stellate/monitor.h"
#include "support/spoiled_oracle.h"

namespace stellate::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class Doctor : public Live {
 protected:
  static CheckOptions Here() {
    CheckOptions options;
    options.connection.server = Server();
    return options;
  }
  static size_t Meshes() { return Monitor::Connect(Here().connection)->Meshes().value().size(); }
  // Whether there are no more than that, or will be within seconds.
  static bool LeavesNone(size_t before) {
    for (int look = 0; look < 500 && Meshes() > before; ++look)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return Meshes() <= before;
  }

  const std::unique_ptr<Manifold> torus_ = Make("torus:1:0.4");
  SpoiledOracle oracle_{*torus_};
};

TEST_F(Doctor, ReportsWhatTheServerFinds) {
  const size_t before = Meshes();
  const CheckReport report = Examined(*torus_, 0.3);
  EXPECT_TRUE(report.ok()) << ToText(report);
  EXPECT_NEAR(*report.reach, 0.4, 0.01);
  EXPECT_EQ(report.pieces, 1);
  EXPECT_GT(report.samples, 100u);
  EXPECT_GT(report.queries, report.samples);
  EXPECT_GT(report.best_batch, 0);
  EXPECT_GT(report.rates.at(0).second, 0);
  EXPECT_EQ(report.epsilon, 0.1);
  EXPECT_THAT(report.epsilon_reason, StartsWith("a quarter of the reach, about 0.4 by "));
  const Finding* const coarse = report.Find("COARSE_EPSILON");
  ASSERT_NE(coarse, nullptr) << ToText(report);
  EXPECT_EQ(coarse->severity, Severity::kWarning);
  EXPECT_EQ(coarse->numbers.at("epsilon"), 0.3);
  EXPECT_EQ(Examined(*torus_, 0.1).Find("COARSE_EPSILON"), nullptr);
  EXPECT_TRUE(LeavesNone(before));
}

TEST_F(Doctor, SaysWhere) {
  oracle_.on_tangents = [](Eigen::MatrixXd& bases) { bases *= 1.01; };
  const CheckReport report = Examined(oracle_);
  const Finding& finding = report.findings.at(0);
  EXPECT_EQ(finding.code, "TANGENT_NOT_ORTHONORMAL");
  ASSERT_EQ(finding.place.size(), 3);
  EXPECT_LT((torus_->ClosestPoint(finding.place).points - finding.place).norm(), 1e-9);
  EXPECT_NEAR(finding.numbers.at("off"), 0.0201, 1e-6);
  const std::string text = ToText(report);
  EXPECT_THAT(text, StartsWith("  error TANGENT_NOT_ORTHONORMAL: the tangent basis at ["));
  EXPECT_THAT(text, HasSubstr("The oracle breaks its contract: 1 error, 0 warnings"));
  size_t longest = 0;
  for (size_t begin = 0, end = 0; end != std::string::npos; begin = end + 1) {
    end = text.find('\n', begin);
    longest = std::max(longest, std::min(end, text.size()) - begin);
  }
  EXPECT_LE(longest, 100u) << text;
}

TEST_F(Doctor, TakesWhatOraclesThrowForFindings) {
  oracle_.on_closest = [](const auto&, Answer&) { throw std::runtime_error("no such surface"); };
  const CheckReport raised = Examined(oracle_);
  ASSERT_NE(raised.Find("RAISED"), nullptr) << ToText(raised);
  EXPECT_THAT(raised.Find("RAISED")->message, HasSubstr("no such surface"));
  oracle_.on_closest = [](const auto&, Answer&) { throw OracleError("ORACLE_SHAPE", "f is wide"); };
  EXPECT_NE(Examined(oracle_).Find("WRONG_SHAPE"), nullptr);
  oracle_.on_closest = [](const auto&, Answer& a) {
    a.points = Eigen::MatrixXd(a.points.topRows(2));
  };
  EXPECT_NE(Examined(oracle_).Find("WRONG_SHAPE"), nullptr);
  oracle_.on_closest = [](const auto&, Answer& a) {
    a.points(0, 0) = std::numeric_limits<double>::quiet_NaN();
  };
  EXPECT_NE(Examined(oracle_).Find("NOT_FINITE"), nullptr);
}

TEST_F(Doctor, TakesWhatOraclesSayOfThemselvesForFindings) {
  oracle_.k = 3;
  EXPECT_NE(Examined(oracle_).Find("BAD_DIMENSIONS"), nullptr);
  oracle_.k = 0;
  const CheckReport report = Examined(oracle_);
  EXPECT_FALSE(report.ok());
  EXPECT_THAT(ToText(report), HasSubstr("dimension is 0 but must be at least 1"));
  oracle_.k = 2;
  oracle_.box.reset();
  EXPECT_NE(Examined(oracle_).Find("NO_WHEREABOUTS"), nullptr);
}

// A figure with a tip at the origin.
TEST_F(Doctor, LooksAtEquationsItself) {
  const Eigen::VectorXd corner = Eigen::VectorXd::Constant(3, 1.5);
  const auto f = [](const Eigen::VectorXd& x) {
    const double square = x.squaredNorm();
    return Eigen::VectorXd::Constant(1, square * square - x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
  };
  ImplicitOracle tip(2, 3, f, ImplicitOracle::Jacobian(), {-corner, corner});
  const CheckReport report = Examined(tip);
  const Finding& finding = report.findings.at(0);
  EXPECT_EQ(finding.code, "SINGULAR") << ToText(report);
  EXPECT_LT(finding.place.norm(), 1e-4);
  EXPECT_THAT(finding.message, Not(HasSubstr("{")));
  EXPECT_THAT(finding.advice, HasSubstr("no epsilon will do"));
  EXPECT_FALSE(report.epsilon.has_value());
  EXPECT_THAT(report.epsilon_reason, HasSubstr("error SINGULAR"));
}

TEST_F(Doctor, StopsWhenItIsToldTo) {
  std::stop_source source;
  int asked = 0;
  oracle_.on_closest = [&](const auto&, Answer&) {
    if (++asked == 3) source.request_stop();
  };
  CheckOptions options = Here();
  options.stop = source.get_token();
  const Expected<CheckReport> report = Check(oracle_, options);
  ASSERT_FALSE(report.has_value());
  EXPECT_EQ(report.error().code, ErrorCode::kStopped);
  EXPECT_LT(asked, 6);
}

TEST_F(Doctor, SaysOfAServerThatIsNotThereWhichItIs) {
  CheckOptions options;
  options.connection.server = "unix:/nowhere/at/all";
  const Expected<CheckReport> report = Check(*torus_, options);
  ASSERT_FALSE(report.has_value());
  EXPECT_EQ(report.error().code, ErrorCode::kServerFailed);
  options = Here();
  options.epsilon = -1;
  EXPECT_EQ(Check(*torus_, options).error().code, ErrorCode::kRefused);
}

TEST_F(Doctor, ChoosesAQuarterOfTheReachWhateverTheUnit) {
  const Expected<ChosenEpsilon> small = ChooseEpsilon(*torus_);  // a private server
  ASSERT_TRUE(small.has_value()) << small.error().message;
  EXPECT_EQ(small->epsilon, 0.1);
  const Expected<ChosenEpsilon> large = ChooseEpsilon(*Make("torus:1000:400"), Here());
  EXPECT_EQ(large->epsilon, 100) << large->reason;
}

TEST_F(Doctor, ChoosesNoEpsilonForAnOracleThatBreaksItsContract) {
  oracle_.on_closest = [](const Eigen::MatrixXd& x, Answer& a) { a.points = (a.points + x) / 2; };
  const Expected<ChosenEpsilon> chosen = ChooseEpsilon(oracle_, Here());
  ASSERT_FALSE(chosen.has_value());
  EXPECT_EQ(chosen.error().code, ErrorCode::kOracleFailed);
  EXPECT_EQ(chosen.error().reason, "ORACLE_BREAKS_CONTRACT");
  EXPECT_THAT(chosen.error().message, HasSubstr("error NOT_IDEMPOTENT"));
  EXPECT_THAT(chosen.error().message, Not(HasSubstr("note ")));
}

}  // namespace
}  // namespace stellate::testing
