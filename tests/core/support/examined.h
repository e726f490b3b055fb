#pragma once

#include <algorithm>
#include <chrono>
#include <exception>
#include <optional>
#include <string>

#include "core/examiner.h"
#include "tests/support/run_mesher.h"

namespace stellate::testing {

inline core::Specification ExaminationOf(const Oracle& oracle) {
  core::Specification spec = SpecificationFor(oracle, 1);
  spec.oracle.local_size = oracle.has_local_size();
  return spec;
}

// Examines an oracle in this process; what it throws is a fault of its.
inline core::ExaminationReport Examine(Oracle& oracle, std::optional<double> epsilon = {}) {
  const auto examiner = core::Examiner::Create(ExaminationOf(oracle), epsilon);
  while (const auto batch = examiner->NextBatch()) {
    const auto begin = std::chrono::steady_clock::now();
    try {
      const core::Answers answers = AnswersOf(oracle, *batch);
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
      const core::Status taken = examiner->Absorb(answers, took.count());
      if (!taken.ok()) examiner->Fail({core::OracleFault::Kind::kShape, taken.message});
    } catch (const std::exception& error) {
      examiner->Fail({core::OracleFault::Kind::kRaised, error.what()});
    }
  }
  return examiner->report();
}

// Null: it was not found.
inline const core::Finding* Find(const core::ExaminationReport& report, const std::string& code) {
  const auto found = std::find_if(report.findings.begin(), report.findings.end(),
                                  [&](const core::Finding& f) { return f.code == code; });
  return found == report.findings.end() ? nullptr : &*found;
}

}  // namespace stellate::testing
