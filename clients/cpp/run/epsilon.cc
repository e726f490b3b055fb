#include "run/epsilon.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "shared/doctor.h"

namespace stellate {
namespace {

std::string Show(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

}  // namespace

Expected<ChosenEpsilon> ChooseEpsilon(Oracle& oracle) {
  return client::ChooseEpsilon(Check(oracle));
}

Expected<ChosenEpsilon> client::ChooseEpsilon(CheckReport report) {
  if (!report.ok()) {
    std::erase_if(report.findings, [](const Finding& f) { return f.severity != Severity::kError; });
    return Fail(ErrorCode::kOracleFailed,
                "the reach is taken from the oracle's answers, and they cannot be trusted:\n" +
                    ToText(report),
                "ORACLE_BREAKS_CONTRACT");
  }
  if (!report.reach || !std::isfinite(*report.reach)) {
    return Fail(ErrorCode::kOracleFailed,
                "the reach is taken from the oracle's answers, and they show none: say how large "
                "epsilon shall be",
                "ORACLE_NO_REACH");
  }
  const double chosen =
      std::strtod(Show("%.2g", *report.reach / doctor::kAutoEpsilon).c_str(), nullptr);
  return ChosenEpsilon{chosen, "a quarter of the reach, about " + Show("%.3g", *report.reach) +
                                   " by " + std::to_string(report.queries) + " queries"};
}

}  // namespace stellate
