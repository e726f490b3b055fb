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
// Up to this, a mesh that is refused for its size alone is mostly right.
inline constexpr double kNearlyFine = 1.5;
// The ratio to advise: smaller than kCoarse, since the reach is estimated from above.
inline constexpr double kAdvised = 0.4;

// One sentence for messages: what to do if a manifold that is meshed without walls ends, or may
// end.
inline constexpr const char* kDeclareWalls =
    "If the manifold has a boundary, it has to be declared by walls: see \"Boundaries and "
    "domains\" in the documentation";

// Returns a sentence for the verdict: the mesh is `ratio` times as coarse as a reach, and what to
// do. `where`: the place where it was seen, or empty.
std::string TooCoarse(double ratio, double reach, const std::string& where);

// Returns what to look for if a wall is inactive, to be appended to a problem; empty if all walls
// are active. `met`: the walls that have vertices.
std::string AboutInactiveWall(int walls, WallSet met);

// Returns what a certificate says that the mesh is: "a closed orientable manifold of dimension 2
// with 1 component and Euler characteristic 0".
std::string DescribeManifold(int k, bool has_boundary, const Certificate& certificate);

// Collects what speaks against a mesh, in plain words: problems refuse it, warnings do not.
//
//   findings.Refuse(Findings::kLinks, "the link of vertex 3 is not a sphere");
//   findings.Conclude(k, spec, certificate);  // the verdict
class Findings {
 public:
  // The subject that explains the most comes first: a hole explains a boundary star, not the other
  // way round.
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

  // Adds a theorem about this mesh, in plain words, that holds if no problem refuses it. `covered`:
  // the mesh meets every component of M.
  void Prove(std::string theorem, bool covered) {
    theorem_ = std::move(theorem);
    covered_ = covered;
  }

  bool clean() const { return problems_.empty(); }
  // Returns the first problem, and the next if there are more, as sentences; empty if clean.
  std::string Problems() const;
  const std::string& theorem() const { return theorem_; }  // empty: none
  const std::vector<std::string>& warnings() const { return warnings_; }
  // Whether an undeclared boundary may be the cause of one of the problems.
  bool MayBeBoundary() const;
  // Whether the mesh is refused for its size alone, and is not so coarse that little else could be
  // seen.
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
