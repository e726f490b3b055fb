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

double Rounded(double length) { return std::strtod(Show("%.2g", length).c_str(), nullptr); }

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
                "epsilon should be",
                "ORACLE_NO_REACH");
  }
  return ChosenEpsilon{Rounded(*report.reach / doctor::kAutoEpsilon),
                       "a quarter of the reach, about " + Show("%.3g", *report.reach) + " by " +
                           std::to_string(report.queries) + " queries"};
}

void client::Tell(const std::string& epsilon_reason, Report* report) {
  if (epsilon_reason.empty()) return;
  report->epsilon_reason = epsilon_reason;
  report->text += "      epsilon  " + Show("%g", report->epsilon) + ", " + epsilon_reason + "\n";
}

std::optional<ChosenEpsilon> client::Finer(const Report& report) {
  const Certificate& c = report.certificate;
  const bool ended = report.termination == Termination::kConverged ||
                     report.termination == Termination::kNoProgress;
  const double coarsest = doctor::kSafeRatio * c.estimated_reach;
  if (c.certified || c.reach_refuted || !ended) return std::nullopt;
  if (!(coarsest > 0 && coarsest < report.epsilon)) return std::nullopt;
  const std::string why = "a quarter of the reach, about " + Show("%.3g", c.estimated_reach) +
                          " by the certificate of epsilon " + Show("%g", report.epsilon) +
                          ", which was too coarse";
  const double quarter = Rounded(c.estimated_reach / doctor::kAutoEpsilon);
  const double least = Rounded(doctor::kAutoLeastShare * report.epsilon);
  if (quarter < least) return ChosenEpsilon{least, "no finer in one step, though " + why};
  return ChosenEpsilon{quarter, why};
}

}  // namespace stellate
