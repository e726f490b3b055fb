#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stellate/oracle.h"

namespace stellate {

enum class Severity {
  kError,    // a mesh will be wrong
  kWarning,  // it may be wrong
  kNote,     // worth knowing
};

// One result of Check, in the words that all clients share (findings.txt).
struct Finding {
  Severity severity = Severity::kNote;
  std::string code;     // stable, e.g. "NOT_CLOSEST"
  std::string message;  // what is wrong, with the first counterexample
  std::string advice;   // what to do; may be empty
};

// Lengths in the coordinates' unit.
struct CheckReport {
  std::vector<Finding> findings;  // errors first, then warnings, then notes; one of a kind
  std::uint64_t samples = 0;      // points of M found
  std::uint64_t queries = 0;      // asked of the oracle
  std::optional<double> reach;    // an estimate from above
  std::optional<int> pieces;      // components with at least one of these points
  std::vector<std::pair<int, double>> rates;  // queries a second, by batch size
  int best_batch = 0;

  bool ok() const;                                     // no error among the findings
  const Finding* Find(const std::string& code) const;  // null: there is none
};
std::string ToText(const CheckReport& report);  // several lines, for people

struct CheckOptions {
  std::optional<double> epsilon;  // that a mesh is planned with
  std::uint64_t random_seed = 1;  // of the questions
};

// Tests an oracle against the contract of Oracle, before a mesh depends on it.
//
//   const stellate::CheckReport report = stellate::Check(oracle);
//   if (!report.ok()) std::cerr << stellate::ToText(report);
//
// Tests shapes, finiteness and determinism; whether closest points are closest, on M, and at right
// angles to M; the dimension; tangent bases; intersections with flats; smoothness; the reach, and
// whether epsilon suits it; the number of components; speed. An exception from the oracle is a
// finding too.
CheckReport Check(Oracle& oracle, const CheckOptions& options = {});

}  // namespace stellate
