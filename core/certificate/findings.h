#pragma once

#include <string>
#include <vector>

#include "core/report.h"

namespace stellate::core {

// eps / reach: up to this, meshing was seen to work reliably.
inline constexpr double kCoarse = 0.8;

// A warning for people where epsilon is above kCoarse times the (estimated) reach, else empty.
std::string CoarsenessWarning(double epsilon, double reach);

// What speaks against a mesh, in plain words: problems refuse it, warnings do not.
class Findings {
 public:
  // Most telling first: a hole explains a boundary star, not the other way round.
  enum Subject {
    kComplex = 0,
    kLinks,
    kConsistency,
    kStars,
    kSize,
    kVertices,
    kBarycentres,
    kCoverage,
    kFibres,
    kReach,
    kConvergence,
  };

  // Keeps the first problem of each subject.
  void Refuse(Subject subject, std::string problem);
  void Warn(std::string warning) { warnings_.push_back(std::move(warning)); }

  bool clean() const { return problems_.empty(); }
  // Sets certified, verdict and warnings from these findings and the certificate's values.
  void Conclude(int k, Certificate& certificate) const;

 private:
  struct Problem {
    Subject subject;
    std::string text;
  };
  std::vector<Problem> problems_;  // by subject
  std::vector<std::string> warnings_;
};

}  // namespace stellate::core
