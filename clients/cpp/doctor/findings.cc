#include "doctor/findings.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <sstream>
#include <stdexcept>

namespace stellate {
namespace doctor {
namespace {

constexpr Eigen::Index kShownEntries = 6;

struct Words {
  Severity severity = Severity::kNote;
  std::string message, advice;
};

Severity SeverityOf(const std::string& name) {
  if (name == "error") return Severity::kError;
  if (name == "warning") return Severity::kWarning;
  if (name == "note") return Severity::kNote;
  throw std::logic_error("findings.txt: severity '" + name + "'");
}

// A block: CODE severity, the message, and perhaps "- advice".
const std::map<std::string, Words>& AllWords() {
  static const std::map<std::string, Words> words = [] {
    std::map<std::string, Words> all;
    std::istringstream text(kFindingsText);
    Words* block = nullptr;
    for (std::string line; std::getline(text, line);) {
      if (line.empty()) {
        block = nullptr;
      } else if (line[0] == '#') {
        continue;
      } else if (block == nullptr) {
        const size_t space = line.find(' ');
        block = &all[line.substr(0, space)];
        block->severity = SeverityOf(line.substr(space + 1));
      } else if (line.rfind("- ", 0) == 0) {
        block->advice = line.substr(2);
      } else {
        block->message = line;
      }
    }
    return all;
  }();
  return words;
}

std::string Fill(std::string text, std::initializer_list<Value> values) {
  for (const Value& value : values) {
    const std::string slot = "{" + value.name + "}";
    for (size_t at = text.find(slot); at != std::string::npos; at = text.find(slot, at)) {
      text.replace(at, slot.size(), value.shown);
      at += value.shown.size();
    }
  }
  return text;
}

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

// Lines of at most `width` columns, all but the first indented.
std::string Fold(const std::string& text, size_t width, size_t indent) {
  std::istringstream words(text);
  std::string folded, line = text.substr(0, text.find_first_not_of(' '));
  bool empty = true;
  for (std::string word; words >> word; empty = false) {
    if (!empty && line.size() + 1 + word.size() > width) {
      folded += line + "\n";
      line = std::string(indent, ' ') + word;
    } else {
      line += (empty ? "" : " ") + word;
    }
  }
  return folded + line + "\n";
}

}  // namespace

std::string Show(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

std::string Show(std::int64_t value) {
  std::string digits = std::to_string(value);
  const size_t first = value < 0 ? 1 : 0;
  for (size_t at = digits.size(); at > first + 3; at -= 3) digits.insert(at - 3, 1, ',');
  return digits;
}

std::string Show(const Eigen::VectorXd& point) {
  std::string text = "[";
  for (Eigen::Index i = 0; i < std::min(point.size(), kShownEntries); ++i) {
    char entry[32];
    std::snprintf(entry, sizeof entry, "%s%.6g", i > 0 ? ", " : "", point[i]);
    text += entry;
  }
  return text + (point.size() > kShownEntries ? ", ...]" : "]");
}

Finding MakeFinding(const std::string& code, std::initializer_list<Value> values) {
  const auto found = AllWords().find(code);
  if (found == AllWords().end()) throw std::logic_error("findings.txt has no " + code);
  const Words& words = found->second;
  return {words.severity, code, Fill(words.message, values), Fill(words.advice, values)};
}

}  // namespace doctor

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
  constexpr size_t kWidth = 100, kIndent = 8;
  std::string text;
  int errors = 0, warnings = 0;
  for (const Finding& f : report.findings) {
    errors += f.severity == Severity::kError;
    warnings += f.severity == Severity::kWarning;
    const std::string name = doctor::Name(f.severity);
    std::string line = std::string(7 - name.size(), ' ') + name + " " + f.code + ": " + f.message;
    if (line.back() != '.') line += '.';
    if (!f.advice.empty()) line += " " + f.advice;
    text += doctor::Fold(line, kWidth, kIndent);
  }
  return text + "The oracle " + (report.ok() ? "keeps" : "breaks") +
         " its contract: " + doctor::Show(errors) + (errors == 1 ? " error, " : " errors, ") +
         doctor::Show(warnings) + (warnings == 1 ? " warning, from " : " warnings, from ") +
         doctor::Show(static_cast<std::int64_t>(report.queries)) + " queries about " +
         doctor::Show(static_cast<std::int64_t>(report.samples)) + " points of M.\n";
}

}  // namespace stellate
