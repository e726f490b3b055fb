#pragma once

#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/interruption.h"
#include "core/certificate/certifier.h"
#include "core/complex/cavities.h"
#include "core/complex/star_complex.h"
#include "core/mesher.h"
#include "core/refinement/batch_parts.h"
#include "core/refinement/independent_set.h"
#include "core/refinement/rules.h"
#include "core/refinement/tangent_finder.h"

namespace stellate::core {

// The constants of a run, defaults filled in for this k.
struct ResolvedCriteria {
  double epsilon, radius_edge_bound, picking_radius, small_sliver_radius, advance_step;
  ShapeBounds shape;
  int candidates, flat_alternations;
  bool ask_ahead;
  Judging judging;
  double size_rate, max_deviation;  // infinity: no such criterion
  bool sizes_given;                 // graded by what the client says
  bool graded() const { return std::isfinite(size_rate) || std::isfinite(max_deviation); }
  bool estimates_sizes() const { return graded() && !sizes_given; }
};
ResolvedCriteria Resolve(const Specification& spec);

// The algorithm of Sec. 5.3.5 as the state machine of mesher.h, for one k.
//
// A round goes: Plan (which simplices break a rule, which of them can be mended together, what to
// ask for that), answers, tangents where the client gives none, Insert. When no rule applies any
// more the certifier asks its own questions.
template <int K>
class Refinement final : public Mesher {
 public:
  explicit Refinement(Specification spec);

  const QueryBatch* NextBatch() override;
  Expected<MeshDelta> Absorb(const Answers& answers) override;
  void Interrupt() override { interruption_.Raise(); }
  void Cancel() override { Finish(Termination::kCancelled); }
  void Fail(Status reason) override;

  const Specification& specification() const override { return spec_; }
  const Progress& progress() const override { return progress_; }
  const Report& report() const override { return report_; }
  Eigen::MatrixXd Points() const override;
  Eigen::MatrixXd Tangents() const override { return complex_.TangentMatrix(); }
  std::vector<std::uint32_t> Simplices() const override {
    return filled_over_ ? filled_.simplices : complex_.Simplices();
  }

 private:
  enum class Stage { kPoints, kAlternate, kTangents, kCertify };
  // What the points that are asked for are for.
  enum class Purpose { kSeeds, kTargets, kEvidence };

  // Points that a rehearsal wants, in the order of their insertion.
  struct Ahead {
    Eigen::MatrixXd points;    // d x n
    Eigen::MatrixXd tangents;  // (K rows of d) x n, predicted
    Eigen::VectorXd spacing;   // n, predicted distance to the nearest
    std::vector<Rule> rules;   // n, what they are for

    Eigen::Index size() const { return points.cols(); }
  };

  // A rehearsal: goes on from where `original` is, with an oracle that is not the client's, and
  // stops where the certificate would begin.
  explicit Refinement(const Refinement& original);

  // Asking ahead (refinement_ahead.cc).
  void AskAhead();
  void Rehearse(Refinement& rehearsal) const;
  void InsertAhead();

  // Planning (refinement_plan.cc).
  void AskForSeeds();
  void Plan();
  std::vector<Target<K>> SizeAndShapeTargets();
  std::vector<Target<K>> SliverAndConsistencyTargets();
  void FillCavitiesIfAny(const std::vector<std::optional<Violation<K>>>& found);
  bool IsFilled(std::uint32_t star, const Violation<K>& violation) const;
  Target<K> Aim(std::uint32_t star, const Violation<K>& violation) const;
  void AskForTargets();
  void AskAgain(const QueryBlock& block, Stage stage);
  // Without queries: asks for all that is needed of a point of M that may be inserted.
  QueryBlock NewBlock(QueryKind kind) const;
  bool FindsFlats(const Target<K>& target) const;

  // Answers (refinement.cc), insertion (refinement_insert.cc), the end (refinement_end.cc).
  QueryBatch& OpenBatch();
  Status CheckIdempotence(const Answers& answers) const;
  void Advance(const Answers& answers);
  void TakePoints(const Answers& answers);
  void AfterPoints();
  void AfterTangents();
  void InsertSeeds();
  void InsertTargets();
  // What becomes of the answer to a target of R1 or R2, seen from the complex before the round.
  struct Fitness {
    bool found = false;
    bool duplicate = false;  // too near another point
    bool mends = false;      // takes the violating simplex out of its star
    bool calm = false;       // lies near where it was aimed
  };
  double Clearance(const Target<K>& target) const;
  Fitness JudgeRefined(std::size_t target) const;
  void InsertRefined(std::size_t target, Fitness fitness, bool* all_calm);
  void InsertGoodPoint(std::size_t target, int best);
  int BestCandidate(std::size_t target) const;
  void Discourage(std::uint32_t star);
  void Append(Eigen::Index candidate, std::uint32_t near);
  void Insert(Eigen::Index candidate, Rule rule, std::uint32_t near);
  void Commit();
  void StartCertificate();

  // Answers that were not inserted (refinement_evidence.cc).
  void KeepAsEvidence();
  std::vector<double> UncoveredEvidence() const;
  double ClearanceOf(const double* y, std::uint32_t* nearest) const;
  bool AskForEvidence(const std::vector<double>& points);
  void InsertEvidence();

  // What goes on without end (refinement_stop.cc).
  bool HasLeftBox();
  bool HasStalled();
  std::string WhyStopped() const;
  void WarnOfBox(Certificate* certificate) const;

  void HandOutFilled();
  double MaxAgreedNorm2(std::uint32_t p) const;
  std::uint64_t SimplexCount() const {
    return filled_over_ ? filled_.simplices.size() / (K + 1) : complex_.simplex_count();
  }
  void Finish(Termination termination);
  void DescribeUnfinished();
  std::string WhatIsLeft() const;
  void UpdateProgress();

  // Graded sizes (refinement_size.cc).
  double SizeSeenFrom(std::uint32_t star) const;
  double LocalSize(std::uint32_t star) const;  // estimated
  void SpreadSizes();
  double WantedFor(double size) const;  // circumradius
  double BoundFor(double size) const;   // the same within what is meshed
  double FinestBound() const;
  double SizeBound(std::uint32_t star) const;  // of R1
  void JudgeAllSizes();
  void DescribeSizes(StarFacts* facts);

  // So large that M between may be anything: more than twice the size asked for.
  bool IsCoarse(std::uint32_t star, const Violation<K>& violation) const {
    return violation.radius > 2 * SizeBound(star);
  }
  Eigen::Index CandidateCount(const Target<K>& target) const {
    return target.violation.rule >= Rule::kSliver ? criteria_.candidates : 1;
  }

  Specification spec_;
  ResolvedCriteria criteria_;
  Interruption interruption_;
  StarComplex<K> complex_;
  Progress progress_;
  Report report_;

  const bool rehearsal_ = false;
  std::vector<Rule> inserted_rules_;  // of a rehearsal's points
  Stage stage_ = Stage::kPoints;
  Purpose purpose_ = Purpose::kSeeds;
  std::optional<QueryBatch> batch_;
  std::optional<BatchParts> parts_;  // of batch_, if that is too large to ask at once
  std::uint64_t whole_rounds_ = 0;   // rounds in which parts count once
  MeshDelta delta_;                  // of the round being absorbed
  bool over_ = false;

  // The open round: targets, and the points asked for them, candidate by candidate.
  std::vector<Target<K>> targets_;
  std::vector<Eigen::Index> first_candidate_;         // by target; one past the last at the end
  std::vector<std::pair<int, Eigen::Index>> places_;  // by candidate: block and column
  Eigen::MatrixXd candidates_;                        // d x n, as asked for
  Eigen::MatrixXd points_;                            // d x n, as answered
  std::vector<std::uint8_t> found_;
  std::vector<std::uint8_t> answered_;  // found, whether or not tangents were
  std::vector<std::uint8_t> used_;      // inserted
  Eigen::MatrixXd tangents_;            // (K rows of d) x n
  Eigen::VectorXd sizes_;               // n, where the client gives them
  TangentFinder tangent_finder_;
  int alternations_left_ = 0;
  Ahead ahead_;                         // asked for with the targets' candidates, after them
  bool ahead_failed_ = false;           // the last round that asked ahead had nothing of it
  Eigen::MatrixXd idempotence_sample_;  // d x m, asked for again with the next batch
  Eigen::VectorXd idempotence_sizes_;   // m, as told first

  // By star.
  enum Standing : std::uint8_t { kFine, kSizeOrShape, kSliverOrInconsistent };
  std::vector<double> given_size_;  // where the client gives them
  // Where they are estimated, and by the certificate in any case:
  std::vector<double> size_seen_;      // the local feature size seen from the star
  std::vector<double> local_size_;     // the same, 1-Lipschitz over the stars, when last spread
  std::uint32_t sizes_judged_at_ = 0;  // vertices then
  bool sizes_judged_ = false;          // nothing has changed since
  std::vector<std::uint8_t> standing_;
  std::vector<std::uint8_t> discouraged_;  // failed attempts; above kGiveUp: left alone
  std::vector<std::uint8_t> no_flat_;      // an intersection was not found: ask for closest points
  struct Active {
    std::uint32_t star;
    Violation<K> violation;
  };
  std::vector<Active> active_;               // the violations of R1 and R2, one a star
  std::vector<std::uint32_t> suspects_;      // stars to judge by R3 and R4
  std::vector<std::uint32_t> blemished_;     // stars with a violation of R3 or R4
  std::vector<std::uint32_t> filled_stars_;  // such stars that filling their cavities mends
  FilledCavities filled_;                    // of the complex as it is, if filled_stars_ has any
  bool filled_over_ = false;                 // the mesh is the filled one, no more the stars' union
  bool all_suspect_ = true;                  // R3 and R4 were not judged yet
  std::uint64_t before_good_points_ = 0;     // vertices when R1 and R2 first held

  // Points of M that were answered and are no vertices, d each: the mesh must cover them.
  std::vector<double> evidence_;
  int evidence_rounds_ = 0;

  std::uint32_t boxed_ = 0;                      // vertices held against the client's box
  std::uint64_t outside_box_ = 0;                // those that lie outside
  double farthest_outside_ = 0;                  // of them, length
  std::uint64_t left_then_ = ~std::uint64_t{0};  // violations, at the last progress
  std::uint64_t stalled_rounds_ = 0;             // since then
  bool front_moved_ = false;                     // in the round
  bool judges_all_ = true;                       // all_suspect_ of the round before

  bool covers_box_ = false;  // each seed of a covered box has its closest point
  std::unique_ptr<Certifier> certifier_;
  std::uint64_t too_fine_ = 0;  // stars whose given size asks for less than is meshed
  std::vector<std::uint32_t> certified_simplices_;
};

extern template class Refinement<1>;
extern template class Refinement<2>;
extern template class Refinement<3>;
extern template class Refinement<4>;
extern template class Refinement<5>;

}  // namespace stellate::core
