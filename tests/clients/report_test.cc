#include "stellate/report.h"

#include <gtest/gtest.h>

#include <limits>

namespace stellate {
namespace {

Report Good() {
  Report report;
  report.termination = Termination::kConverged;
  report.counts.vertices = 1234567;
  report.counts.simplices = 42;
  report.certificate.certified = true;
  report.certificate.verdict = "every check holds";
  report.certificate.components = 1;
  report.certificate.euler_characteristic = -8;
  return report;
}

TEST(ReportText, SaysWhetherItIsCertified) {
  const std::string text = ToText(Good());
  EXPECT_NE(text.find("1,234,567 vertices, 42 simplices"), std::string::npos) << text;
  EXPECT_NE(text.find("  CERTIFIED\n      verdict  every check holds"), std::string::npos) << text;
  EXPECT_NE(text.find("1 component, Euler characteristic -8"), std::string::npos) << text;
  Report bad = Good();
  bad.certificate.certified = false;
  bad.certificate.warnings = {"epsilon is coarse"};
  EXPECT_NE(ToText(bad).find("NOT CERTIFIED"), std::string::npos);
  EXPECT_NE(ToText(bad).find("warning  epsilon is coarse"), std::string::npos);
}

TEST(ReportText, LeavesOutTheTopologyOfNothing) {
  Report report = Good();
  report.certificate.components = 0;
  EXPECT_EQ(ToText(report).find("topology"), std::string::npos);
}

TEST(ReportJson, EscapesTextAndWritesNullForWhatJsonLacks) {
  Report report = Good();
  report.failure_reason = "ORACLE_FAILED";
  report.failure_message = "a \"quote\", a \\ and a\nnew line";
  report.certificate.estimated_reach = std::numeric_limits<double>::infinity();
  const std::string json = ToJson(report);
  EXPECT_EQ(json.rfind("{\"termination\": \"CONVERGED\", \"failure\": {", 0), 0u) << json;
  EXPECT_NE(json.find(R"("a \"quote\", a \\ and a\u000anew line")"), std::string::npos) << json;
  EXPECT_NE(json.find("\"estimated_reach\": null"), std::string::npos) << json;
  EXPECT_NE(json.find("\"euler_characteristic\": -8"), std::string::npos) << json;
  EXPECT_NE(json.find("\"vertices\": 1234567"), std::string::npos) << json;
  EXPECT_EQ(json.find('\n'), std::string::npos);
}

}  // namespace
}  // namespace stellate
