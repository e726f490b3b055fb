#include "core/refinement/inserter.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"
#include "core/base/vector_ops.h"
#include "core/boundary/inactive_faces.h"
#include "core/parts/share_out.h"
#include "core/rules/count_bad.h"
#include "core/rules/r5_protection.h"

namespace stellate::core {
namespace {

// Targets of a round lie R apart: answers no farther than this share of R from their targets lie at
// least R / 2 apart, the distance that Caution::empty_ball wants.
constexpr double kNearAim = 0.25;
// Good points are chosen off the centre.
constexpr double kGoodPointSpacing = 0.25;
// A split falls near the middle of what it splits.
constexpr double kSplitSpacing = 0.3;
// True points differ from predicted ones: a point nearer to another than this share of its planned
// spacing would cost quality.
constexpr double kKeptSpacing = 0.95;

}  // namespace

template <int K>
Inserter<K>::Inserter(const EngineParts<K>& to, const CandidateSet<K>& candidates,
                      const AnsweredPoints& answers, const Caution& caution)
    : to_(to), candidates_(candidates), answers_(answers), caution_(caution) {
  done_.used.assign(static_cast<std::size_t>(candidates.size()), 0);
}

template <int K>
Inserted Inserter<K>::Run() {
  SetAllNearTarget(Judge());
  for (std::size_t i = 0; i < candidates_.targets.size(); ++i) {
    CheckInterruption(i);
    InsertTarget(i);
  }
  InsertPlanned();
  return std::move(done_);
}

template <int K>
bool Inserter<K>::Judge() {
  const std::vector<Target<K>>& targets = candidates_.targets;
  best_.assign(targets.size(), 0);
  refined_.assign(targets.size(), {});
  const auto judge = [&](std::size_t i) {
    if (targets[i].violation.rule >= Rule::kShape)
      best_[i] = BestCandidate(i);
    else
      refined_[i] = JudgeRefined(i);
  };
  // A target is dear, so that few make up a share.
  ShareOut(
      to_.stars.peers(), targets.size(), 1, judge,
      [&](std::size_t i, Peers::Bytes* message) {
        Pack(best_[i], message);
        Pack(refined_[i], message);
      },
      [&](std::size_t i, Parcel* parcel) {
        parcel->Unpack(1, &best_[i]);
        parcel->Unpack(1, &refined_[i]);
      });
  return std::all_of(refined_.begin(), refined_.end(), [](const RefinedPoint& judged) {
    return !judged.found || judged.near_target;
  });
}

template <int K>
typename Inserter<K>::Outcome Inserter<K>::InsertTarget(std::size_t i) {
  return candidates_.targets[i].violation.rule >= Rule::kShape ? InsertGoodPoint(i, best_[i])
                                                               : InsertRefined(i, refined_[i]);
}

// Returns the radius of the empty ball around the insertion point. If the star's point has a
// protecting ball, the two balls are orthogonal.
template <int K>
double Inserter<K>::EmptyRadius(const Target<K>& t) const {
  const double ball_radius2 = to_.stars.sample().ProtectingRadius2(t.star);
  return ball_radius2 == 0 ? t.radius
                           : std::sqrt(std::max(t.radius * t.radius - ball_radius2, 0.0));
}

template <int K>
double Inserter<K>::Clearance(const Target<K>& t) const {
  const double radius = EmptyRadius(t);
  if (t.violation.encroached) return kSplitSpacing * radius;
  return t.is_coarse() ? caution_.coarse_spacing * std::min(t.size_bound, radius)
                       : caution_.empty_ball * radius;
}

template <int K>
typename Inserter<K>::RefinedPoint Inserter<K>::JudgeRefined(std::size_t i) const {
  const Target<K>& t = candidates_.targets[i];
  const Eigen::Index c = candidates_.first[i];
  RefinedPoint judged;
  judged.found = answers_.found[static_cast<std::size_t>(c)];
  if (!judged.found) return judged;
  const double* y = answers_.points.col(c).data();
  const Stars<K>& stars = to_.stars;
  judged.duplicate =
      stars.sample().AnyWithin(y, Clearance(t)) || stars.sample().InProtectingBall(y);
  judged.cuts_violation = !judged.duplicate && stars.CutsVertex(VertexOf(t), y);
  judged.encroached = stars.EncroachedBy(y, t.violation.walls);
  judged.beyond = BeyondFrom(t, c);
  judged.near_target =
      !caution_.is_speculative &&
      Distance(y, candidates_.points.col(c).data(), stars.sample().d()) <= kNearAim * t.radius;
  return judged;
}

template <int K>
typename Inserter<K>::Outcome Inserter<K>::InsertRefined(std::size_t i, RefinedPoint judged) {
  const Target<K>& t = candidates_.targets[i];
  const Eigen::Index c = candidates_.first[i];
  if (!judged.found) {
    if (!candidates_.in_flats[i] || caution_.is_speculative) return NoteFailedAttempt(t.star);
    to_.violations.NoteNoFlat(t.star);
    return Outcome::kPutOff;
  }
  if (YieldsToFaces(judged, t, c)) return NoteFailedAttempt(t.star);
  const double* y = answers_.points.col(c).data();
  // Another point of this round may be near, unless all lie near their targets.
  if (judged.cuts_violation && !all_near_target_)
    judged.duplicate = to_.stars.sample().AnyWithin(y, Clearance(t));
  if (judged.duplicate || !judged.cuts_violation) {
    done_.duplicates += judged.duplicate;
    return NoteFailedAttempt(t.star);
  }
  done_.front_moved = done_.front_moved || t.violation.fake;
  return Insert(c, t.violation.rule, t.star);
}

// A point that encroaches on a face of lower dimension, or lies beyond a wall, is not inserted:
// that face is refined instead, or discovered.
template <int K>
bool Inserter<K>::YieldsToFaces(const RefinedPoint& judged, const Target<K>& t, Eigen::Index c) {
  if (judged.encroached) {
    const auto& [star, vertex, sector] = *judged.encroached;
    to_.boundary.NoteEncroached(
        {star, to_.stars.cell(star, sector).key(vertex), t.violation.rule, sector});
    return true;
  }
  if (!judged.beyond) return false;
  to_.boundary.Discover(answers_.points.col(c), t.violation.walls, *judged.beyond);
  return true;
}

// Of a target's answer: as AnsweredPoints::Beyond.
template <int K>
std::optional<int> Inserter<K>::BeyondFrom(const Target<K>& t, Eigen::Index c) const {
  return answers_.BeyondFrom(c, to_.stars.sample().sectors().SignsOf(t.star, t.violation.sector));
}

// Whether a point that is in M encroaches on no face, and is in no protecting ball.
template <int K>
bool Inserter<K>::FitsFaces(Eigen::Index c) const {
  return !to_.stars.sample().InProtectingBall(answers_.points.col(c).data()) &&
         !to_.stars.EncroachedBy(answers_.points.col(c).data(), answers_.WallsOf(c));
}

template <int K>
int Inserter<K>::BestCandidate(std::size_t i) const {
  const Target<K>& t = candidates_.targets[i];
  const Stars<K>& stars = to_.stars;
  thread_local typename Stars<K>::Tentative tentative;
  const double delta = to_.criteria.shape.protection;
  int best = -1, fewest = std::numeric_limits<int>::max() / 2;
  const Eigen::Index first = candidates_.first[i];
  for (Eigen::Index c = first; c < candidates_.first[i + 1] && (fewest > 0 || delta > 0); ++c) {
    if (!answers_.found[static_cast<std::size_t>(c)]) continue;
    const double* y = answers_.points.col(c).data();
    if (!stars.CutsVertex(VertexOf(t), y) ||
        stars.sample().AnyWithin(y, kGoodPointSpacing * EmptyRadius(t)) || BeyondFrom(t, c) ||
        !FitsFaces(c))
      continue;
    const int index = static_cast<int>(c - first);
    if (to_.criteria.candidates == 1) return index;
    stars.TryPoint(y, answers_.tangents.col(c).data(), t.star, &tentative, answers_.WallsOf(c),
                   answers_.ConormalsOf(c), answers_.SignsOf(c));
    const Site guest{stars.size(),
                     y,
                     answers_.tangents.col(c).data(),
                     answers_.WallsOf(c),
                     answers_.ConormalsOf(c),
                     answers_.SignsOf(c)};
    // Of points that leave no simplex unprotected, one that resolves more is better.
    const int resolved = delta > 0 ? CountResolved<K>(stars, guest, tentative, delta) : 0;
    const int bad = CountBad<K>(stars, guest, tentative, to_.criteria.shape,
                                to_.criteria.small_sliver_radius * t.radius, fewest + resolved) -
                    resolved;
    if (bad < fewest) {
      fewest = bad;
      best = index;
    }
  }
  return best;
}

template <int K>
typename Inserter<K>::Outcome Inserter<K>::InsertGoodPoint(std::size_t i, int best) {
  const Target<K>& t = candidates_.targets[i];
  if (best < 0) {
    // The first candidate that encroaches on a face has that face refined.
    for (Eigen::Index c = candidates_.first[i]; c < candidates_.first[i + 1]; ++c) {
      if (!answers_.found[static_cast<std::size_t>(c)]) continue;
      RefinedPoint judged;
      judged.encroached = to_.stars.EncroachedBy(answers_.points.col(c).data(), t.violation.walls);
      judged.beyond = BeyondFrom(t, c);
      if (YieldsToFaces(judged, t, c)) break;
    }
    to_.violations.NoteNoFlat(t.star);  // if that was why
    return NoteFailedAttempt(t.star);
  }
  const Eigen::Index c = candidates_.first[i] + best;
  if (to_.stars.sample().AnyWithin(answers_.points.col(c).data(),
                                   kGoodPointSpacing * EmptyRadius(t)))
    return Outcome::kPutOff;  // another point of this round is near
  return Insert(c, t.violation.rule, t.star);
}

template <int K>
void Inserter<K>::InsertPlanned() {
  const PlannedPoints& planned = candidates_.planned;
  for (Eigen::Index i = 0; i < planned.size(); ++i) {
    CheckInterruption(static_cast<std::size_t>(i));
    if (to_.is_full()) break;
    const Eigen::Index c = candidates_.drawn() + i;
    if (!answers_.found[static_cast<std::size_t>(c)]) continue;
    if (to_.stars.sample().Codimension(answers_.WallsOf(c)) == K &&
        to_.boundary.KeepCrowd(answers_, c, BoundaryState<K>::kSameCorner * to_.criteria.epsilon))
      continue;
    if (const auto beyond = answers_.Beyond(c)) {
      to_.boundary.Discover(answers_.points.col(c), answers_.WallsOf(c), *beyond);
      continue;
    }
    if (!FitsFaces(c)) continue;
    if (const std::optional<int> next = answers_.NextWall(c); next && to_.boundary.stage() == 0)
      to_.boundary.Discover(answers_.points.col(c), answers_.WallsOf(c), *next);
    if (K - to_.stars.sample().Codimension(answers_.WallsOf(c)) >
        to_.boundary.stage()) {  // corners and their shells come first
      to_.boundary.KeepSeed(answers_.points.col(c), answers_.WallsOf(c));
      continue;
    }
    if (to_.stars.sample().AnyWithin(answers_.points.col(c).data(),
                                     kKeptSpacing * planned.spacing[i])) {
      ++done_.duplicates;
      if (answers_.WallsOf(c) != 0 && !HasPointOn<K>(to_.stars, answers_.WallsOf(c)))
        to_.boundary.KeepSeed(answers_.points.col(c), answers_.WallsOf(c));
      continue;
    }
    Insert(c, planned.rules[static_cast<std::size_t>(i)], Stars<K>::kNone);
  }
}

template <int K>
typename Inserter<K>::Outcome Inserter<K>::Insert(Eigen::Index c, Rule rule, std::uint32_t near) {
  to_.stars.Add(answers_.points.col(c).data(), answers_.tangents.col(c).data(), near,
                answers_.WallsOf(c), answers_.ConormalsOf(c), answers_.SignsOf(c));
  if (answers_.sizes.size() > 0) to_.sizes.AppendGiven(answers_.sizes[c]);
  done_.used[static_cast<std::size_t>(c)] = 1;
  done_.rules.push_back(rule);
  return Outcome::kInserted;
}

// A speculative run gives a star up after one attempt: true points will do what the surrogate
// refuses, since shorter steps would only crowd the border of the part that it knows.
template <int K>
typename Inserter<K>::Outcome Inserter<K>::NoteFailedAttempt(std::uint32_t star) {
  if (caution_.is_speculative)
    to_.violations.GiveUp(star);
  else
    to_.violations.NoteFailedAttempt(star);
  return Outcome::kFailed;
}

STELLATE_INSTANTIATE_CLASS(Inserter)

}  // namespace stellate::core
