#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/instantiate.h"
#include "core/refinement/candidate_set.h"
#include "core/refinement/engine_parts.h"

namespace stellate::core {

// How near to their targets answers are assumed to be.
struct Caution {
  // In a coarse mesh the closest point of a circumcentre may be anywhere. If it is nearer to the
  // sample than this share of the size bound, or of a shorter step, shorten the step instead of
  // inserting it.
  double coarse_spacing = 0.5;
  // Otherwise the ball around the circumcentre is empty, except for curvature. An answer in it that
  // has a sample point nearer than this share of the circumradius shows that the sample is too
  // coarse. Inserting it could make edges shorter than the one that violates R2 (rho0 = 2), without
  // end.
  double empty_ball = 0.5;
  // The answers come from a surrogate: none is assumed to lie near its target, and a star whose
  // target has no answer is skipped.
  bool is_speculative = false;
};
// A speculative run inserts less: later rounds know better.
inline constexpr Caution kSpeculativeCaution = {0.9, 0.9, true};

// What one round inserted.
struct Inserted {
  std::vector<std::uint8_t> used;  // by candidate
  std::vector<Rule> rules;         // by inserted point: the rule that it was for
  std::uint64_t duplicates = 0;    // answers too near to another point
  bool front_moved = false;        // a star on the advancing front was fixed
};

// Inserts the answered candidates that help: for a target of R1 or R2 its candidate, if that
// removes the violation; for one of R3 or R4 the best candidate. Each is tested against the complex
// before the round. Then inserts the planned points that are not too near to others. Commit the
// complex afterwards.
template <int K>
class Inserter {
 public:
  // Stops inserting planned points where the engine is full.
  Inserter(const EngineParts<K>& to, const CandidateSet<K>& candidates,
           const AnsweredPoints& answers, const Caution& caution);

  Inserted Run();

  // The steps of Run. Call Judge first: it returns whether all answers of R1 and R2 lie near their
  // targets, and so cannot be near each other. If other inserters have parts of the round, pass
  // them the conjunction (SetAllNearTarget). Then call InsertTarget for each target in order.
  // kPutOff: the target is unchanged, because its star needs another kind of query, or another
  // point came near.
  enum class Outcome : std::uint8_t { kInserted, kFailed, kPutOff };
  bool Judge();
  void SetAllNearTarget(bool all) { all_near_target_ = all; }
  Outcome InsertTarget(std::size_t target);

 private:
  // The answer to a target of R1 or R2, seen from the complex before the round.
  struct RefinedPoint {
    bool found = false;
    bool duplicate = false;       // too near another point
    bool cuts_violation = false;  // takes the violating simplex out of its star
    bool near_target = false;     // lies near its target
    // Manifolds with boundary: the face simplex that it encroaches on; the wall that it lies
    // beyond.
    std::optional<typename Stars<K>::CellVertex> encroached;
    std::optional<int> beyond;
  };
  double EmptyRadius(const Target<K>& target) const;
  double Clearance(const Target<K>& target) const;
  RefinedPoint JudgeRefined(std::size_t target) const;
  Outcome InsertRefined(std::size_t target, RefinedPoint judged);
  int BestCandidate(std::size_t target) const;
  Outcome InsertGoodPoint(std::size_t target, int best);
  void InsertPlanned();
  bool YieldsToFaces(const RefinedPoint& judged, const Target<K>& target, Eigen::Index candidate);
  std::optional<int> BeyondFrom(const Target<K>& target, Eigen::Index candidate) const;
  bool FitsFaces(Eigen::Index candidate) const;
  static typename Stars<K>::CellVertex VertexOf(const Target<K>& target) {
    return {target.star, target.violation.vertex, target.violation.sector};
  }
  Outcome Insert(Eigen::Index candidate, Rule rule, std::uint32_t near);
  Outcome NoteFailedAttempt(std::uint32_t star);

  EngineParts<K> to_;
  const CandidateSet<K>& candidates_;
  const AnsweredPoints& answers_;
  Caution caution_;
  std::vector<int> best_;              // by target of R3 and R4: its candidate; -1: none
  std::vector<RefinedPoint> refined_;  // by target of R1 and R2
  bool all_near_target_ = false;
  Inserted done_;
};

STELLATE_DECLARE_CLASS(Inserter)

}  // namespace stellate::core
