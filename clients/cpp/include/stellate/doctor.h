#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "stellate/connection.h"
#include "stellate/error.h"
#include "stellate/oracle.h"
#include "stellate/report.h"

namespace stellate {

enum class Severity {
  kError,    // a mesh will be wrong
  kWarning,  // it may be wrong
  kNote,     // worth knowing
};

// One result of Check.
struct Finding {
  Severity severity = Severity::kNote;
  std::string code;                            // stable, e.g. "NOT_CLOSEST"
  std::string message;                         // what is wrong, with the first counterexample
  std::string advice;                          // what to do; may be empty
  Eigen::VectorXd place = {};                  // the counterexample, d coordinates; may be empty
  std::map<std::string, double> numbers = {};  // of the message, by name, e.g. "degrees"
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
  std::optional<double> epsilon;  // that kAuto stands for
  std::string epsilon_reason;     // why it is this, or why there is none

  bool ok() const;                                     // no error among the findings
  const Finding* Find(const std::string& code) const;  // null: there is none
};
std::string ToText(const CheckReport& report);  // several lines, for people
std::string ToJson(const CheckReport& report);  // as CheckReport of doctor.proto, indented

struct CheckOptions {
  std::optional<double> epsilon;  // that a mesh is planned with
  std::uint64_t random_seed = 1;  // of the questions
  Connection connection = {};     // without a server: a private one, as MeshOptions has it
  std::stop_token stop = {};      // ends the examination with the error kStopped
};

// Has a server test an oracle against the contract of Oracle, before a mesh depends on it.
//
//   const auto report = stellate::Check(oracle);
//   if (!report) std::cerr << report.error().message;
//   else if (!report->ok()) std::cerr << stellate::ToText(*report);
//
// Tests shapes, finiteness and determinism; whether closest points are closest, on M, and at right
// angles to M; the dimension; tangent bases; intersections with flats; smoothness; the reach, and
// whether epsilon suits it; the number of components; speed. What an oracle throws is a finding,
// not an exception. Returns an error if there was no examination: kServerFailed, kRefused, or
// kStopped.
Expected<CheckReport> Check(Oracle& oracle, const CheckOptions& options = {});

// Returns a quarter of the reach that Check estimates, to two digits. kOracleFailed, with the
// findings, if the oracle breaks its contract; or an error of Check.
Expected<ChosenEpsilon> ChooseEpsilon(Oracle& oracle, const CheckOptions& options = {});

}  // namespace stellate
