#include "core/refinement/refinement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "core/base/arenas.h"
#include "core/base/basis_layout.h"
#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/certificate/findings.h"
#include "core/geometry/reach.h"

namespace stellate::core {
namespace {

// Closest points of answered points may move by this share of epsilon: positions wrong by 0.01
// epsilon are still meshed well.
constexpr double kIdempotenceTolerance = 1e-3;
// A point moved by no more of the distances between numbers there was moved by rounding.
constexpr double kRoundings = 64;

// Differences of closest points are taken over this share of epsilon: the error is its square over
// the reach's, far below what directions may be wrong by (0.03).
constexpr double kTangentStep = 0.01;

// With a declared reach: what tangents found by differences may be wrong by, radians.
constexpr double kTangentError = 0.03;

// Cells begin as fake simplices a little larger than the step of the front.
constexpr double kInradius = 1.2;
// Theta0 by k: for k = 3 larger bounds do not terminate, for k <= 2 none is needed. A regular
// simplex's fatness falls quickly with k, so the bound falls with it.
constexpr double kDefaultSliverBound[kMaxDimension + 1] = {0, 0, 0, 0.2, 0.15, 0.1};

// With a declared reach: M turns by no more under a simplex of the size asked for, radians. The
// rest of the right angle is for the simplex itself.
constexpr double kProofTurn = 0.7;

constexpr double kDefaultAdvanceEpsilons = 3;
constexpr double kDefaultAdvanceShare = 0.1;  // of the bounding box's diagonal

}  // namespace

ResolvedCriteria Resolve(const Specification& spec) {
  const Criteria& c = spec.criteria;
  ResolvedCriteria r;
  r.epsilon = spec.epsilon;
  if (spec.declared_reach) {
    r.shape.reach = *spec.declared_reach;
    r.epsilon = std::min(r.epsilon, RadiusThatTurns(kProofTurn, r.shape.reach));
  }
  r.radius_edge_bound = c.radius_edge_bound;
  r.shape.sliver_bound = c.sliver_bound.value_or(kDefaultSliverBound[spec.dimension]);
  r.picking_radius = c.picking_radius;
  r.small_sliver_radius = c.small_sliver_radius;
  r.candidates = c.candidates.value_or(spec.dimension <= 2 ? 1 : 10);
  r.flat_alternations = c.flat_alternations;
  r.ask_ahead = c.ask_ahead;
  r.size_rate = c.size_rate.value_or(INFINITY);
  r.max_deviation = c.max_deviation.value_or(INFINITY);
  // Common centres mean something well below the local feature size; they are looked for up to
  // epsilon, which is far above it where the size is graded.
  const bool flats = spec.dimension <= 2 || r.graded();
  r.judging = c.judging.value_or(flats ? Judging::kFlats : Judging::kCommonCentre);
  r.sizes_given = r.graded() && spec.oracle.local_size;
  double step = kDefaultAdvanceEpsilons * r.epsilon;
  if (spec.bounding_box) {
    const double diagonal = (spec.bounding_box->upper - spec.bounding_box->lower).norm();
    step = std::max(step, kDefaultAdvanceShare * diagonal);
  }
  r.advance_step = c.advance_step.value_or(step);
  return r;
}

template <int K>
Refinement<K>::Refinement(Specification spec)
    : spec_(std::move(spec)),
      criteria_(Resolve(spec_)),
      complex_(spec_.ambient_dimension, criteria_.epsilon,
               kInradius * std::max(criteria_.advance_step, criteria_.epsilon), criteria_.judging),
      tangent_finder_(K, spec_.ambient_dimension, kTangentStep * criteria_.epsilon,
                      spec_.random_seed, kTangentError * spec_.declared_reach.value_or(INFINITY)) {
  AskForSeeds();
}

// What the client has in hand: the round's batch or a part of it.
template <int K>
QueryBatch& Refinement<K>::OpenBatch() {
  const std::uint64_t most = spec_.limits.max_batch_queries;
  if (most == 0 || static_cast<std::uint64_t>(batch_->size()) <= most) return *batch_;
  if (!parts_) parts_.emplace(*batch_, most);
  return parts_->part();
}

template <int K>
const QueryBatch* Refinement<K>::NextBatch() {
  if (over_ || !batch_) return nullptr;
  QueryBatch& batch = OpenBatch();
  batch.round = progress_.round + 1;
  return &batch;
}

template <int K>
Status Refinement<K>::CheckIdempotence(const Answers& answers) const {
  if (idempotence_sample_.cols() == 0) return Status::Ok();
  const AnswerBlock& again = answers.blocks.back();
  for (Eigen::Index i = 0; i < idempotence_sample_.cols(); ++i) {
    if (!again.found.empty() && !again.found[static_cast<std::size_t>(i)]) continue;
    const double moved = (again.points.col(i) - idempotence_sample_.col(i)).norm();
    if (moved <= kIdempotenceTolerance * spec_.epsilon) {
      if (again.sizes.size() == 0 || AreOneSize(again.sizes[i], idempotence_sizes_[i])) continue;
      return {StatusCode::kOracleBadSize,
              Message("query ", i, " of block ", answers.blocks.size() - 1,
                      " was a point that closest_point itself had returned: its size was ",
                      idempotence_sizes_[i], " then and is ", again.sizes[i],
                      " now; the size must depend on the point alone")};
    }
    std::string message = Message(
        "closest_point is not idempotent: query ", i, " of block ", answers.blocks.size() - 1,
        " was a point that closest_point itself had returned, and it was moved by ", moved,
        ", more than ", kIdempotenceTolerance,
        " epsilon; closest_point must leave points of the manifold where they are");
    const double apart = std::numeric_limits<double>::epsilon() *
                         idempotence_sample_.col(i).lpNorm<Eigen::Infinity>();
    if (moved <= kRoundings * apart)
      message += Message("; there, so far from the origin for this epsilon, numbers are ",
                         Brief(apart), " apart: move the manifold nearer");
    return {StatusCode::kOracleNotIdempotent, std::move(message)};
  }
  return Status::Ok();
}

template <int K>
Expected<MeshDelta> Refinement<K>::Absorb(const Answers& answers) {
  if (over_ || !batch_)
    return Refuse(StatusCode::kFailedPrecondition, "Absorb without a batch: the run is over");
  const QueryBatch& asked = OpenBatch();
  if (answers.blocks.size() != asked.blocks.size())
    return Refuse(StatusCode::kOracleShape,
                  "got " + std::to_string(answers.blocks.size()) + " answer blocks for " +
                      std::to_string(asked.blocks.size()) + " query blocks; send one for each");
  for (std::size_t b = 0; b < answers.blocks.size(); ++b) {
    const QueryBlock& block = asked.blocks[b];
    if (answers.blocks[b].points.cols() != block.size())
      return Refuse(StatusCode::kOracleShape, "block " + std::to_string(b) + " has " +
                                                  std::to_string(answers.blocks[b].points.cols()) +
                                                  " answers for " + std::to_string(block.size()) +
                                                  " queries; send one for each");
    if (rehearsal_) continue;
    if (Status s = CheckAnswers(spec_, block, 0, answers.blocks[b]); !s.ok())
      return tl::unexpected<Status>(s);
  }
  const bool complete = !parts_ || parts_->is_last();
  const std::optional<Answers> joined =
      complete && parts_ ? std::optional(parts_->With(answers)) : std::nullopt;
  const Answers& all = joined ? *joined : answers;
  if (complete) {
    if (Status s = CheckIdempotence(all); !s.ok()) return tl::unexpected<Status>(s);
    idempotence_sample_.resize(0, 0);
  }

  const Progress progress_before = progress_;
  const Report report_before = report_;
  ++progress_.round;
  ++report_.counts.rounds;
  const auto size = static_cast<std::uint64_t>(asked.size());
  progress_.queries += size;
  (stage_ == Stage::kTangents ? report_.counts.tangent_queries : report_.counts.queries) += size;
  delta_ = {};
  delta_.revision = progress_.round;
  delta_.first_vertex = complex_.size();
  if (complete) {
    parts_.reset();
    batch_.reset();
    ++whole_rounds_;
  }

  const auto advance = [&] {
    if (complete)
      Advance(all);
    else
      parts_->Take(answers);
    if (!over_ && batch_ && progress_.round >= spec_.limits.max_rounds)
      Finish(Termination::kRoundBudget);
    UpdateProgress();
  };
  if (rehearsal_) {
    advance();  // within the original's round, and interrupted with it
  } else if (!WithThreads(spec_.threads, interruption_, advance)) {
    // It may have ended in the very moment, but nobody has seen that.
    over_ = false;
    progress_ = progress_before;
    report_ = report_before;
    return Refuse(StatusCode::kCancelled, "the computation was interrupted");
  }
  delta_.points =
      Eigen::Map<const Eigen::MatrixXd>(complex_.points().data(), complex_.d(), complex_.size())
          .rightCols(complex_.size() - static_cast<Eigen::Index>(delta_.first_vertex));
  return std::move(delta_);
}

// From the answers to the next batch, or to the end.
template <int K>
void Refinement<K>::Advance(const Answers& answers) {
  switch (stage_) {
    case Stage::kCertify:
      certifier_->Absorb(answers.blocks);
      if (const auto* blocks = certifier_->NextBlocks())
        batch_ = QueryBatch{0, *blocks};
      else if (filled_over_ || certifier_->certificate().epsilon_over_reach > kCoarse ||
               !AskForEvidence(certifier_->Uncovered()))
        Finish(Termination::kConverged);
      break;
    case Stage::kTangents:
      tangent_finder_.Absorb(answers.blocks.front());
      if (const QueryBlock* more = tangent_finder_.Next())
        AskAgain(*more, Stage::kTangents);
      else
        AfterTangents();
      break;
    case Stage::kPoints:
    case Stage::kAlternate:
      TakePoints(answers);
      break;
  }
  if (batch_ && idempotence_sample_.cols() > 0) {
    QueryBlock again;
    again.points = idempotence_sample_;
    again.want_sizes = criteria_.sizes_given;
    batch_->blocks.push_back(std::move(again));
  }
}

// Sorts the answers back into candidates.
template <int K>
void Refinement<K>::TakePoints(const Answers& answers) {
  const AnswerBlock& first = answers.blocks.front();
  const auto is_found = [](const AnswerBlock& block, Eigen::Index i) {
    return block.found.empty() ? std::uint8_t{1} : block.found[static_cast<std::size_t>(i)];
  };
  const int d = complex_.d();
  const auto take = [&](Eigen::Index c, const AnswerBlock& block, Eigen::Index column) {
    found_[static_cast<std::size_t>(c)] = is_found(block, column);
    points_.col(c) = block.points.col(column);
    if (criteria_.sizes_given && block.sizes.size() > 0) sizes_[c] = block.sizes[column];
    if (block.tangents.size() == 0) return;
    ToByVector(block.tangents.col(column).data(), d, K, tangents_.col(c).data());
  };
  const bool sorted = stage_ == Stage::kPoints && purpose_ == Purpose::kTargets;
  const Eigen::Index count =
      sorted ? static_cast<Eigen::Index>(places_.size()) : first.points.cols();
  points_.resize(d, count);
  found_.assign(static_cast<std::size_t>(count), 0);
  tangents_.resize(d * K, count);
  sizes_.resize(criteria_.sizes_given ? count : 0);
  for (Eigen::Index c = 0; c < count; ++c) {
    LookUp(static_cast<std::size_t>(c));
    if (!sorted) {
      take(c, first, c);
      continue;
    }
    const auto [block, column] = places_[static_cast<std::size_t>(c)];
    take(c, answers.blocks[static_cast<std::size_t>(block)], column);
  }
  if (purpose_ == Purpose::kTargets && alternations_left_ > 0) {
    // Back to the flat of each candidate, and to M from there.
    --alternations_left_;
    QueryBlock block = NewBlock(QueryKind::kClosestPoint);
    block.points = points_;
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      LookUp(i);
      const double* tangent = complex_.Tangent(targets_[i].star);
      for (Eigen::Index c = first_candidate_[i]; c < first_candidate_[i + 1]; ++c) {
        if (!found_[static_cast<std::size_t>(c)] || targets_[i].violation.fake) continue;
        for (int a = 0; a < K; ++a) {
          const Eigen::Map<const Eigen::VectorXd> t(tangent + a * d, d);
          block.points.col(c) -= t * t.dot(points_.col(c) - candidates_.col(c));
        }
      }
    }
    return AskAgain(block, Stage::kAlternate);
  }
  AfterPoints();
}

template <int K>
void Refinement<K>::AfterPoints() {
  if (spec_.oracle.tangent_basis) return AfterTangents();
  // Tangents of the points that were found, with the stars' own as guesses.
  std::vector<Eigen::Index> known;
  std::vector<const double*> guesses;
  std::vector<double> shares;
  const auto add = [&](Eigen::Index c, const double* guess) {
    if (!found_[static_cast<std::size_t>(c)]) return;
    known.push_back(c);
    guesses.push_back(guess);
    if (criteria_.sizes_given) shares.push_back(BoundFor(sizes_[c]) / criteria_.epsilon);
  };
  if (purpose_ != Purpose::kTargets) {
    for (Eigen::Index c = 0; c < points_.cols(); ++c) add(c, nullptr);
  } else {
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      LookUp(i);
      // Far steps may turn any corner: no guess there.
      const bool far = IsCoarse(targets_[i].star, targets_[i].violation);
      const double* guess = far ? nullptr : complex_.Tangent(targets_[i].star);
      for (Eigen::Index c = first_candidate_[i]; c < first_candidate_[i + 1]; ++c) add(c, guess);
    }
    for (Eigen::Index i = 0; i < ahead_.size(); ++i)
      add(first_candidate_.back() + i, ahead_.tangents.col(i).data());
  }
  if (known.empty()) return AfterTangents();
  tangent_finder_.Start(points_(Eigen::all, known), std::move(guesses), std::move(shares));
  AskAgain(*tangent_finder_.Next(), Stage::kTangents);
}

template <int K>
void Refinement<K>::AfterTangents() {
  answered_ = found_;
  used_.assign(found_.size(), 0);
  if (!spec_.oracle.tangent_basis) {
    Eigen::Index next = 0;
    for (Eigen::Index c = 0; c < points_.cols(); ++c) {
      auto& found = found_[static_cast<std::size_t>(c)];
      if (!found) continue;
      tangents_.col(c) = tangent_finder_.tangents().col(next);
      found = tangent_finder_.ok()[static_cast<std::size_t>(next++)];
    }
  }
  switch (purpose_) {
    case Purpose::kSeeds:
      InsertSeeds();
      break;
    case Purpose::kTargets:
      InsertTargets();
      InsertAhead();
      break;
    case Purpose::kEvidence:
      InsertEvidence();
      break;
  }
  if (over_) return;
  KeepAsEvidence();
  Commit();
  Plan();
}

// Brings the stars and all that is known of them up to date with the appended points.
template <int K>
void Refinement<K>::Commit() {
  const std::uint32_t first = static_cast<std::uint32_t>(standing_.size());
  const bool judged = !all_suspect_;
  std::vector<std::uint32_t> around;
  typename StarComplex<K>::Change change = complex_.Commit(judged ? &around : nullptr);
  std::vector<std::uint32_t> touched = std::move(change.stars);
  touched.resize(touched.size() + complex_.size() - first);
  std::iota(touched.end() - (complex_.size() - first), touched.end(), first);
  standing_.resize(complex_.size(), kFine);
  discouraged_.resize(complex_.size(), 0);
  no_flat_.resize(complex_.size(), 0);
  delta_.added = std::move(change.added);
  delta_.removed = std::move(change.removed);

  if (criteria_.estimates_sizes()) {
    size_seen_.resize(complex_.size(), INFINITY);
    ParallelFor(touched.size(),
                [&](std::size_t i) { size_seen_[touched[i]] = SizeSeenFrom(touched[i]); });
    sizes_judged_ = false;
  }
  std::vector<std::optional<Violation<K>>> violations(touched.size());
  ParallelFor(touched.size(), [&](std::size_t i) {
    violations[i] = WorstSizeOrShape<K>(complex_, touched[i], SizeBound(touched[i]),
                                        criteria_.radius_edge_bound);
  });
  for (std::size_t i = 0; i < touched.size(); ++i) {
    LookUp(i);
    const std::uint32_t p = touched[i];
    discouraged_[p] = no_flat_[p] = 0;
    standing_[p] = kFine;
  }
  std::erase_if(active_, [&, step = std::size_t{0}](const Active& a) mutable {
    LookUp(step++);
    return standing_[a.star] != kSizeOrShape;
  });
  for (std::size_t i = 0; i < touched.size(); ++i) {
    LookUp(i);
    if (!violations[i]) continue;
    standing_[touched[i]] = kSizeOrShape;
    active_.push_back({touched[i], *violations[i]});
  }
  if (judged) {
    suspects_.insert(suspects_.end(), around.begin(), around.end());
    suspects_.insert(suspects_.end(), touched.begin(), touched.end());
  }
}

template class Refinement<1>;
template class Refinement<2>;
template class Refinement<3>;
template class Refinement<4>;
template class Refinement<5>;

}  // namespace stellate::core
