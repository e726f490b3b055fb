#pragma once

#include <string>

#include "core/report.h"
#include "core/specification.h"
#include "tests/truth/cases.h"

namespace stellate::truth {

enum class Outcome {
  kRight,       // certified, and it is so
  kFalse,       // certified, and it is not so
  kUnseen,      // the same, except components that no answer fell on
  kRefused,     // converged, not certified
  kUnfinished,  // ended before
};

struct Run {
  Outcome outcome = Outcome::kUnfinished;
  std::string told;  // the verdict, or the error
  core::Counts counts;
  double estimated_reach = 0;
  bool proved = false;  // what is certified, from the declared reach
  double seconds = 0;   // of this process, the mesher's share
};

core::Specification SpecificationOf(const Case& c, const ShapeOracle& oracle);
// `thorough`: with every question that a certificate may ask. `declared`: so many true reaches are
// declared, or 0.
Run Judge(const Case& c, bool thorough, double declared = 0);

}  // namespace stellate::truth
