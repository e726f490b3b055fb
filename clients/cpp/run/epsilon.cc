#include "run/epsilon.h"

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
