#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/instantiate.h"
#include "core/refinement/candidate_set.h"
#include "core/refinement/face_book.h"
#include "core/refinement/size_field.h"
#include "core/refinement/violation_book.h"

namespace stellate::core {

// How far answers are trusted to be where they were aimed.
struct Caution {
  // Where all is coarse the image of a circumcentre may fall anywhere: one that comes nearer to the
  // sample than this share of the size asked for, or of a shorter step, would cost quality, so that
  // the step is shortened instead.
  double coarse_spacing = 0.5;
  // Otherwise the ball around the circumcentre is empty except for curvature. A point of it that
  // has the sample nearer than this share of the circumradius says that the sample is too coarse
  // for that; to insert it could make edges shorter than the one that R2 complained of (rho0 = 2),
  // without end.
  double empty_ball = 0.5;
  // A guess only: no answer is relied upon to lie near its target, and a star whose target the
  // guess has no answer for is left alone.
  bool is_rehearsal = false;
};
// What is rehearsed can wait until it is known better.
inline constexpr Caution kRehearsalCaution = {0.9, 0.9, true};

// What one round inserted.
struct Inserted {
  std::vector<std::uint8_t> used;  // by candidate
  std::vector<Rule> rules;         // by inserted point: what it is for
  std::uint64_t duplicates = 0;    // answers too near to another point
  bool front_moved = false;        // a star on the advancing front was mended
};

// Inserts the answered candidates that help: of a target of R1 or R2 the one if it mends anything,
// of R3 and R4 the best, each judged against the complex as it was before the round; then the
// planned points that still have room. The complex waits for its Commit afterwards.
template <int K>
class Inserter {
 public:
  // All are borrowed, for as long as the inserter lives.
  struct Parts {
    StarComplex<K>& complex;
    SizeField<K>& sizes;
    ViolationBook<K>& book;
    const ResolvedCriteria& criteria;
    FaceBook<K>& faces;
  };
  // max_vertices: the planned points go no further.
  Inserter(const Parts& to, const CandidateSet<K>& candidates, const AnsweredPoints& answers,
           const Caution& caution, std::uint64_t max_vertices);

  Inserted Run();

  // The steps of a run. Judge: returns whether all points of R1 and R2 lie near where they were
  // aimed, and so cannot have come near each other; to be told of all of the round, if others have
  // some of it. InsertTarget: in the order of the round. Returns what became of it; kPutOff: it is
  // as it was, for its star to be asked about otherwise, or since another point came near.
  enum class Outcome : std::uint8_t { kInserted, kFailed, kPutOff };
  bool Judge();
  void TellAllNearAim(bool all) { all_near_aim_ = all; }
  Outcome InsertTarget(std::size_t target);

 private:
  // The answer to a target of R1 or R2, seen from the complex before the round.
  struct RefinedPoint {
    bool found = false;
    bool duplicate = false;       // too near another point
    bool cuts_violation = false;  // takes the violating simplex out of its star
    bool near_aim = false;        // lies near where it was aimed
    // Of manifolds with boundary: it would spoil that face simplex; it lies beyond that wall.
    std::optional<typename StarComplex<K>::CellVertex> encroached;
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
  bool FitsFaces(Eigen::Index candidate) const;
  WallSet WallsOf(Eigen::Index candidate) const {
    return answers_.walls.empty() ? 0 : answers_.walls[static_cast<std::size_t>(candidate)];
  }
  const double* ConormalsOf(Eigen::Index candidate) const {
    return answers_.walls.empty() ? nullptr : answers_.conormals.col(candidate).data();
  }
  Outcome Insert(Eigen::Index candidate, Rule rule, std::uint32_t near);
  Outcome NoteFailedAttempt(std::uint32_t star);

  Parts to_;
  const CandidateSet<K>& candidates_;
  const AnsweredPoints& answers_;
  Caution caution_;
  std::uint64_t max_vertices_;
  std::vector<int> best_;              // by target of R3 and R4: its candidate; -1: none
  std::vector<RefinedPoint> refined_;  // by target of R1 and R2
  bool all_near_aim_ = false;
  Inserted done_;
};

STELLATE_DECLARE_CLASS(Inserter)

}  // namespace stellate::core
