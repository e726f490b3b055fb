#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/complex/star_complex.h"
#include "core/refinement/candidate_set.h"
#include "core/refinement/criteria.h"
#include "core/refinement/face_book.h"
#include "core/refinement/filled_mesh.h"
#include "core/refinement/inserter.h"
#include "core/refinement/size_field.h"
#include "core/refinement/violation_book.h"
#include "core/report.h"

namespace stellate::core {

// A corner where more walls than K meet, such that M has no inside there, or more than K - 1 of
// them
// (`along`) meet along an edge that leaves it, or there are more than can be told apart.
struct CrowdedCorner {
  Eigen::VectorXd point;
  WallSet walls, along;
};

// The algorithm of Sec. 5.3.5 between rounds: the sample, its stars, and all that is known of them.
// A round of whoever drives it is
//
//   targets = Plan()                        which simplices break a rule
//   targets = Select(targets)               which of them can be mended together
//   candidates = Draw(targets, round)       what to ask for
//   Insert(candidates, answers); Commit()   what the answers change
//
// A value: a copy goes on from the same state by itself. It asks nobody, and knows nothing of
// batches.
template <int K>
class Engine {
 public:
  using Change = typename StarComplex<K>::Change;

  Engine(const Specification& spec, const ResolvedCriteria& criteria);

  // A copy to be driven by guesses instead of M's points, to this share of the sizes asked for: 1,
  // or less where they are the same everywhere.
  Engine ForRehearsal(double share = 1) const;

  bool is_full() const { return complex_.size() >= max_vertices_; }

  // The violations to mend next, by the first rules that any star breaks. Empty: no more can be
  // done, see AllRulesHold. Nothing: points are inserted without end.
  std::optional<std::vector<Target<K>>> Plan();
  // Plan's parts: R1 and R2, of all stars that break them; then, if none does, R3 and R4.
  std::vector<Target<K>> SizeAndShapeTargets() const;
  std::vector<Target<K>> GoodPointTargets();
  // After a Plan that found no targets.
  bool AllRulesHold() const;
  std::vector<Target<K>> Select(const std::vector<Target<K>>& targets) const;
  CandidateSet<K> Draw(std::vector<Target<K>> targets, std::uint64_t round) const;

  Inserted Insert(const CandidateSet<K>& candidates, const AnsweredPoints& answers);
  // The same step by step, for who has only a part of the round's targets.
  Inserter<K> InserterOf(const CandidateSet<K>& candidates, const AnsweredPoints& answers);
  // Appends a candidate whatever the rules say. REQUIRES: !is_full() and that it was found.
  void Append(const AnsweredPoints& answers, Eigen::Index candidate);
  // The same for a sample that is laid before there is any star: cheaper, and no search finds the
  // point before Commit.
  void Lay(const AnsweredPoints& answers, Eigen::Index candidate);
  // Brings the stars and all that is known of them up to date with what was inserted.
  Change Commit();
  // Of a manifold with boundary, when no targets are left: points of the faces of this stage that
  // the sample has nothing near, if any, to be asked for and appended.
  PlannedPoints ChooseSeeds();
  // The points of no face that wait to be seeds, all that are known with their tangents.
  AnsweredPoints InteriorSeeds();
  // On to faces of the next dimension. False after the last.
  bool AdvanceStage();
  // The same where the faces of this stage are refined without end: no rule looks at them any more.
  // False in the last stage.
  bool LeaveStage();
  // Of a run that ends before its last stage: makes simplices inside of what there is, however
  // large. `added`, `removed`: as of Commit, of the round.
  void CompleteStars(std::vector<std::uint32_t>* added, std::vector<std::uint32_t>* removed);
  // Whether edges and corners are at rest, and some sharp one is not guarded (core/refinement/
  // guards.h).
  bool WantsGuards(const std::vector<Target<K>>& targets) const;
  // Guards them, or finds what is to be split first, and plans anew. `added`, `removed`: as of
  // Commit, of the round.
  std::optional<std::vector<Target<K>>> GuardSharpEdges(std::vector<std::uint32_t>* added,
                                                        std::vector<std::uint32_t>* removed);
  // Whether corners of more walls than K are as they are is asked for, and they are inserted, or
  // left out where M has no more than that point. One that the refinement cannot cope with, if any.
  PlannedPoints CrowdQuestions() const;
  std::optional<CrowdedCorner> SettleCrowds(const AnsweredPoints& answers);
  // Where faces were discovered since; to be asked for beside the targets.
  PlannedPoints TakeDiscoveries();

  // The point inserted last is known by that name, in place of its id: see StarComplex::NameLast.
  void NameLast(std::uint32_t name) { complex_.NameLast(name); }
  // An attempt to mend that star has failed, elsewhere.
  void NoteFailedAttempt(std::uint32_t star) { book_.NoteFailedAttempt(star); }

  // What grows from the points appended last is judged by all rules once it is whole.
  void JudgeAllAnew();

  // How much is left to do: the vertices still to come, as far as circumradii tell. A cell of
  // circumradius R will have to hold `share` (R / bound)^K more.
  double CountMissing(double share) const;

  const StarComplex<K>& complex() const { return complex_; }
  const ResolvedCriteria& criteria() const { return criteria_; }
  SizeField<K>& sizes() { return sizes_; }
  const SizeField<K>& sizes() const { return sizes_; }
  const ViolationBook<K>& book() const { return book_; }
  FaceBook<K>& faces() { return faces_; }
  const FaceBook<K>& faces() const { return faces_; }
  FilledMesh<K>& filled() { return filled_; }
  const FilledMesh<K>& filled() const { return filled_; }

  // Of a manifold with boundary: the faces that there are, by dimension, the lowest first.
  std::vector<FaceMesh> Faces() const;

  // The mesh: K+1 ascending ids each.
  std::vector<std::uint32_t> Simplices() const;
  std::uint64_t simplex_count() const;

 private:
  void RejudgeSizes();
  bool HasGrownTooMuch() const;
  void RejudgeAll();
  std::vector<typename ViolationBook<K>::Entry> JudgeSizeAndShape(
      const std::vector<std::uint32_t>& stars) const;
  void YieldToFaces(std::vector<Target<K>>* targets);
  PlannedPoints SetCollars();
  bool IsSliverAtBoundary(std::uint32_t star, const Violation<K>& violation) const;
  std::optional<Target<K>> SplitUnderSliver(std::uint32_t star,
                                            const Violation<K>& violation) const;
  bool IsCollar(const typename StarComplex<K>::FaceSimplex& simplex) const;
  std::optional<Target<K>> SplitOf(const typename StarComplex<K>::CellVertex& at, Rule by) const;
  Target<K> Aim(std::uint32_t star, const Violation<K>& violation) const;

  ResolvedCriteria criteria_;
  Caution caution_;
  bool asks_flats_;
  std::uint64_t random_seed_, max_vertices_;
  StarComplex<K> complex_;
  SizeField<K> sizes_;
  ViolationBook<K> book_;
  FaceBook<K> faces_;
  FilledMesh<K> filled_;
  std::uint64_t before_good_points_ = 0;  // vertices when R1 and R2 first held
};

STELLATE_DECLARE_CLASS(Engine)

}  // namespace stellate::core
