#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stellate/oracle.h"

namespace stellate {

enum class Severity {
  kError,    // a mesh will not come out right
  kWarning,  // it may not
  kNote,     // worth knowing
};

// One thing that was found, in the words that all clients share (findings.txt).
struct Finding {
  Severity severity = Severity::kNote;
  std::string code;     // stable, e.g. "NOT_CLOSEST"
  std::string message;  // what is wrong, with the first counterexample
  std::string advice;   // what to do about it; may be empty
};

// Lengths in the coordinates' unit.
struct CheckReport {
  std::vector<Finding> findings;  // errors first, then warnings, then notes; one of a kind
  std::uint64_t samples = 0;      // points of M that were seen
  std::uint64_t queries = 0;      // that it took
  std::optional<double> reach;    // an estimate from above
  std::optional<int> pieces;      // components that points were seen on
  std::vector<std::pair<int, double>> rates;  // queries a second, by batch size
  int best_batch = 0;

  bool ok() const;                                     // no error among the findings
  const Finding* Find(const std::string& code) const;  // null if it was not found
};
std::string ToText(const CheckReport& report);  // several lines, for people

struct CheckOptions {
  std::optional<double> epsilon;  // that a mesh is planned with
  std::uint64_t random_seed = 1;  // of the questions
};

// Probes an oracle: is it what Oracle says an oracle is? Shapes, finiteness and determinism;
// closest points that are closest, on M and met at right angles; the dimension; tangent bases;
// intersections with flats; smoothness; the reach, and whether epsilon suits it; the components
// seen; speed. What the oracle throws is a finding too.
CheckReport Check(Oracle& oracle, const CheckOptions& options = {});

}  // namespace stellate
