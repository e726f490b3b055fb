#include "run/check_report.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <sstream>
#include <utility>

namespace stellate {
namespace client {
namespace {

const char* Name(Severity severity) {
  switch (severity) {
    case Severity::kError:
      return "error";
    case Severity::kWarning:
      return "warning";
    case Severity::kNote:
      break;
  }
  return "note";
}

Severity SeverityOf(v1::Severity severity) {
  if (severity == v1::SEVERITY_ERROR) return Severity::kError;
  return severity == v1::SEVERITY_WARNING ? Severity::kWarning : Severity::kNote;
}

v1::Severity SeverityOf(Severity severity) {
  if (severity == Severity::kError) return v1::SEVERITY_ERROR;
  return severity == Severity::kWarning ? v1::SEVERITY_WARNING : v1::SEVERITY_NOTE;
}

Finding ReadFinding(const v1::Finding& m) {
  Finding finding{SeverityOf(m.severity()), m.code(), m.message(), m.advice()};
  finding.place = Eigen::Map<const Eigen::VectorXd>(m.place().data(), m.place_size());
  finding.numbers.insert(m.numbers().begin(), m.numbers().end());
  return finding;
}

v1::CheckReport WriteReport(const CheckReport& report) {
  v1::CheckReport m;
  m.set_ok(report.ok());
  for (const Finding& found : report.findings) {
    v1::Finding& finding = *m.add_findings();
    finding.set_severity(SeverityOf(found.severity));
    finding.set_code(found.code);
    finding.set_message(found.message);
    finding.set_advice(found.advice);
    finding.mutable_place()->Assign(found.place.begin(), found.place.end());
    finding.mutable_numbers()->insert(found.numbers.begin(), found.numbers.end());
  }
  m.set_text(ToText(report));
  m.set_samples(report.samples);
  m.set_queries(report.queries);
  if (report.reach) m.set_reach(*report.reach);
  if (report.pieces) m.set_pieces(static_cast<std::uint32_t>(*report.pieces));
  for (const auto& [batch, rate] : report.rates) {
    v1::BatchRate& measured = *m.add_rates();
    measured.set_batch(static_cast<std::uint32_t>(batch));
    measured.set_queries_per_second(rate);
  }
  m.set_best_batch(static_cast<std::uint32_t>(report.best_batch));
  if (report.epsilon) {
    m.set_epsilon(*report.epsilon);
    m.set_epsilon_reason(report.epsilon_reason);
  } else {
    m.mutable_no_epsilon()->set_reason(report.ok() ? "ORACLE_NO_REACH" : "ORACLE_BREAKS_CONTRACT");
    m.mutable_no_epsilon()->set_message(report.epsilon_reason);
  }
  return m;
}

std::string Grouped(std::uint64_t value) {
  std::string digits = std::to_string(value);
  for (size_t at = digits.size(); at > 3; at -= 3) digits.insert(at - 3, 1, ',');
  return digits;
}

// Lines of at most 100 columns, all but the first indented.
std::string Line(const Finding& finding) {
  constexpr size_t kWidth = 100, kIndent = 8;
  const std::string name = Name(finding.severity);
  std::istringstream words(name + " " + finding.code + ": " + finding.message +
                           (finding.message.ends_with('.') ? "" : ".") + " " + finding.advice);
  std::string folded, line(7 - name.size(), ' ');
  bool is_first = true;
  for (std::string word; words >> word; is_first = false) {
    if (!is_first && line.size() + 1 + word.size() > kWidth) {
      folded += line + "\n";
      line = std::string(kIndent, ' ') + word;
    } else {
      line += (is_first ? "" : " ") + word;
    }
  }
  return folded + line + "\n";
}

std::string Count(const CheckReport& report, Severity severity) {
  const auto count = std::count_if(report.findings.begin(), report.findings.end(),
                                   [&](const Finding& f) { return f.severity == severity; });
  return std::to_string(count) + " " + Name(severity) + (count == 1 ? "" : "s");
}

}  // namespace

CheckReport ReadCheckReport(const v1::CheckReport& m) {
  CheckReport report;
  for (const v1::Finding& finding : m.findings()) report.findings.push_back(ReadFinding(finding));
  report.samples = m.samples();
  report.queries = m.queries();
  if (m.has_reach()) report.reach = m.reach();
  if (m.has_pieces()) report.pieces = static_cast<int>(m.pieces());
  for (const v1::BatchRate& rate : m.rates()) {
    report.rates.emplace_back(static_cast<int>(rate.batch()), rate.queries_per_second());
  }
  report.best_batch = static_cast<int>(m.best_batch());
  if (m.has_epsilon()) report.epsilon = m.epsilon();
  report.epsilon_reason = m.has_epsilon() ? m.epsilon_reason() : m.no_epsilon().message();
  return report;
}

void Add(Finding error, CheckReport* report) {
  if (report->Find(error.code) != nullptr) return;
  report->epsilon.reset();
  report->epsilon_reason =
      "the reach is taken from the oracle's answers, and they cannot be "
      "trusted:\n" +
      Line(error);
  report->epsilon_reason.pop_back();
  report->findings.insert(report->findings.begin(), std::move(error));
}

}  // namespace client

bool CheckReport::ok() const {
  return std::none_of(findings.begin(), findings.end(),
                      [](const Finding& f) { return f.severity == Severity::kError; });
}

const Finding* CheckReport::Find(const std::string& code) const {
  const auto found = std::find_if(findings.begin(), findings.end(),
                                  [&code](const Finding& f) { return f.code == code; });
  return found == findings.end() ? nullptr : &*found;
}

std::string ToText(const CheckReport& report) {
  std::string text;
  for (const Finding& finding : report.findings) text += client::Line(finding);
  return text + "The oracle " + (report.ok() ? "keeps" : "breaks") +
         " its contract: " + client::Count(report, Severity::kError) + ", " +
         client::Count(report, Severity::kWarning) + ", from " + client::Grouped(report.queries) +
         " queries about " + client::Grouped(report.samples) + " points of M.\n";
}

std::string ToJson(const CheckReport& report) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string text;
  const auto written =
      google::protobuf::util::MessageToJsonString(client::WriteReport(report), &text, options);
  return written.ok() ? text : "";
}

}  // namespace stellate
