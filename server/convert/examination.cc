#include "server/convert/examination.h"

#include "text/printable.h"

namespace stellate::server {
namespace {

v1::Severity SeverityOf(core::Severity severity) {
  switch (severity) {
    case core::Severity::kError:
      return v1::SEVERITY_ERROR;
    case core::Severity::kWarning:
      return v1::SEVERITY_WARNING;
    case core::Severity::kNote:
      break;
  }
  return v1::SEVERITY_NOTE;
}

// The same, what workers said made safe for terminals.
core::ExaminationReport Printable(core::ExaminationReport report) {
  for (core::Finding& finding : report.findings) finding.message = text::Printable(finding.message);
  return report;
}

}  // namespace

void ToProto(const core::Finding& finding, v1::Finding* out) {
  out->set_severity(SeverityOf(finding.severity));
  out->set_code(finding.code);
  out->set_message(text::PrintableLines(finding.message));
  out->set_advice(finding.advice);
  for (const double coordinate : finding.place) out->add_place(coordinate);
  for (const auto& [name, value] : finding.numbers) (*out->mutable_numbers())[name] = value;
}

void ToProto(const core::ExaminationReport& report, v1::CheckReport* out) {
  out->set_ok(report.ok());
  for (const core::Finding& finding : report.findings) ToProto(finding, out->add_findings());
  out->set_text(core::ToText(Printable(report)));
  out->set_samples(report.samples);
  out->set_queries(report.queries);
  if (report.reach) out->set_reach(*report.reach);
  if (report.pieces) out->set_pieces(static_cast<std::uint32_t>(*report.pieces));
  for (const core::BatchRate& rate : report.rates) {
    v1::BatchRate& measured = *out->add_rates();
    measured.set_batch(static_cast<std::uint32_t>(rate.batch));
    measured.set_queries_per_second(rate.queries_per_second);
  }
  out->set_best_batch(static_cast<std::uint32_t>(report.best_batch));
  const core::ChosenEpsilon chosen = core::ChooseEpsilon(Printable(report));
  if (chosen.failure.empty()) {
    out->set_epsilon(chosen.epsilon);
    out->set_epsilon_reason(chosen.reason);
  } else {
    out->mutable_no_epsilon()->set_reason(chosen.failure);
    out->mutable_no_epsilon()->set_message(chosen.reason);
  }
}

}  // namespace stellate::server
