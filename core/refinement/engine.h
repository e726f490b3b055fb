#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/complex/stars.h"
#include "core/refinement/boundary_state.h"
#include "core/refinement/candidate_set.h"
#include "core/refinement/criteria.h"
#include "core/refinement/engine_parts.h"
#include "core/refinement/filled_mesh.h"
#include "core/refinement/inserter.h"
#include "core/refinement/protection.h"
#include "core/refinement/size_field.h"
#include "core/refinement/violation_index.h"
#include "core/report.h"

namespace stellate::core {

// The algorithm of Sec. 5.3.5 between rounds: the sample, its stars, and their violations. A round
// is
//
//   targets = *engine.Plan();                        // the simplices that break a rule
//   targets = engine.Select(targets);                // those that can be fixed together
//   candidates = engine.Draw(targets, round);        // the points to query
//   engine.Insert(candidates, answers);
//   change = engine.Commit();                        // updates stars and violations
//
// A value: a copy continues independently from the same state. It sends no queries, and knows no
// batches.
template <int K>
class Engine {
 public:
  using Change = typename Stars<K>::Change;

  // peers: the parts that compute it together, each all of it; borrowed
  Engine(const Specification& spec, const ResolvedCriteria& criteria,
         const Peers& peers = NoPeers());

  // Returns a copy for a speculative run, on a surrogate instead of M. `share`: refine to this
  // share of the sizes; 1, or less where sizes are the same everywhere.
  Engine ForSpeculation(double share = 1) const;

  bool is_full() const { return stars_.size() >= max_vertices_; }

  // Returns the violations to fix next, those of the first rules that any star breaks. Empty:
  // nothing more can be done, see AllRulesHold. Nothing: points are inserted without end.
  std::optional<std::vector<Target<K>>> Plan();
  // The parts of Plan: targets of R1 and R2; if there are none, those of R3 and R4; if all these
  // rules hold, those of R5.
  std::vector<Target<K>> SizeAndShapeTargets() const;
  std::vector<Target<K>> GoodPointTargets();
  std::vector<Target<K>> ProtectionTargets();
  // After a Plan that found no targets: whether R1 to R4 hold.
  bool AllRulesHold() const;
  std::vector<Target<K>> Select(const std::vector<Target<K>>& targets) const;
  CandidateSet<K> Draw(std::vector<Target<K>> targets, std::uint64_t round) const;

  Inserted Insert(const CandidateSet<K>& candidates, const AnsweredPoints& answers);
  // The same step by step, if only a part of the round's targets is at hand.
  Inserter<K> InserterOf(const CandidateSet<K>& candidates, const AnsweredPoints& answers);
  // Appends a candidate without testing any rule. REQUIRES: !is_full(), and the candidate was
  // found.
  void Append(const AnsweredPoints& answers, Eigen::Index candidate);
  // The same for the initial sample, before there is any star: cheaper, but no search finds the
  // point before Commit.
  void AddToSample(const AnsweredPoints& answers, Eigen::Index candidate);
  // Updates the stars and their violations after insertions.
  Change Commit();
  // Manifolds with boundary: goes to faces of the next dimension. Returns false after the last.
  bool AdvanceStage();
  // The same where refining the faces of this stage does not end: rules skip them from now on.
  // Returns false in the last stage.
  bool LeaveStage();
  // Call it when a run ends before its last stage: makes interior simplices of the points that
  // there are, however large. `added`, `removed`: the round's change, as of Commit.
  void CompleteStars(std::vector<std::uint32_t>* added, std::vector<std::uint32_t>* removed);
  // Whether edges and corners have no targets, and some sharp one has no protecting balls
  // (core/refinement/protecting_balls.h).
  bool NeedsProtectingBalls(const std::vector<Target<K>>& targets) const;
  // Sets protecting balls, or finds the edges to split first, and plans again. `added`, `removed`:
  // the round's change, as of Commit.
  std::optional<std::vector<Target<K>>> ProtectSharpEdges(std::vector<std::uint32_t>* added,
                                                          std::vector<std::uint32_t>* removed);
  // Has all rules test all stars again.
  void MarkAllDirty();

  // Estimates the vertices still to come from circumradii: a cell of circumradius R will get
  // `share` (R / bound)^K more.
  double CountMissing(double share) const;

  // For helpers that work on it for one step of a round: FaceSeeds, Corners.
  EngineParts<K> parts() {
    return {stars_, sizes_, violations_, criteria_, boundary_, max_vertices_};
  }
  const Stars<K>& stars() const { return stars_; }
  const ResolvedCriteria& criteria() const { return criteria_; }
  SizeField<K>& sizes() { return sizes_; }
  const SizeField<K>& sizes() const { return sizes_; }
  const ViolationIndex<K>& violations() const { return violations_; }
  BoundaryState<K>& boundary() { return boundary_; }
  const BoundaryState<K>& boundary() const { return boundary_; }
  const Protection<K>& protection() const { return protection_; }
  FilledMesh<K>& filled() { return filled_; }
  const FilledMesh<K>& filled() const { return filled_; }

  // The mesh: K+1 ascending ids each.
  std::vector<std::uint32_t> Simplices() const;
  std::uint64_t simplex_count() const;

 private:
  bool HasGrownTooMuch() const;
  void RejudgeAll();
  std::vector<typename ViolationIndex<K>::Entry> JudgeSizeAndShape(
      const std::vector<std::uint32_t>& stars) const;
  Target<K> TargetOf(std::uint32_t star, const Violation<K>& violation) const;

  ResolvedCriteria criteria_;
  Caution caution_;
  bool asks_flats_;
  std::uint64_t random_seed_, max_vertices_;
  Stars<K> stars_;
  SizeField<K> sizes_;
  ViolationIndex<K> violations_;
  BoundaryState<K> boundary_;
  FilledMesh<K> filled_;
  Protection<K> protection_;
  std::uint64_t before_good_points_ = 0;  // vertices when R1 and R2 first held
};

STELLATE_DECLARE_CLASS(Engine)

}  // namespace stellate::core
