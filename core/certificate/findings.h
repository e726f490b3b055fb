#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "core/base/name_point.h"
#include "core/report.h"
#include "core/specification.h"
#include "core/walls.h"

namespace stellate::core {

// Mesh size over reach: up to this, meshing was seen to work reliably; coarser meshes are refused.
inline constexpr double kCoarse = 0.8;
// Up to this, what is refused for its size alone is mostly right.
inline constexpr double kNearlyFine = 1.5;
// What is advised instead: the reach is estimated from above.
inline constexpr double kAdvised = 0.4;

// That a mesh is `ratio` times as coarse as a reach, and what to do; `where` it was seen, or empty.
std::string TooCoarse(double ratio, double reach, const std::string& where);

// Of a mesh with walls, whose vertices are on the walls `met`: of a wall that none of them is on,
// what to look for, to go on from what was wrong. Empty: there is none.
std::string AboutInactiveWall(int walls, WallSet met);

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
    kTangents,
    kReach,
    kUndeclaredBoundary,
    kBarycentres,
    kCoverage,
    kFibres,
    kComponents,
    kDeviation,
    kDeclaredReach,
    kConvergence,
  };

  // Keeps the first problem of each subject.
  void Refuse(Subject subject, std::string problem);
  void Warn(std::string warning) { warnings_.push_back(std::move(warning)); }

  // A theorem about this mesh, in plain words, that holds if nothing refuses it. `covered`: it
  // knows every component of M.
  void Prove(std::string theorem, bool covered) {
    theorem_ = std::move(theorem);
    covered_ = covered;
  }

  bool clean() const { return problems_.empty(); }
  // Whether an unannounced boundary may be behind one of the problems.
  bool MayBeBoundary() const;
  // Whether that is all that speaks against it, and not so much that little else could be seen.
  bool IsOnlyTooCoarse(double epsilon_over_reach) const;
  // Sets certified, level, verdict and warnings from these findings and the certificate's values.
  void Conclude(int k, const Specification& spec, Certificate& certificate) const;

 private:
  struct Problem {
    Subject subject;
    std::string text;
  };
  std::vector<Problem> problems_;  // by subject
  std::vector<std::string> warnings_;
  std::string theorem_;
  bool covered_ = false;
};

}  // namespace stellate::core
