#include "core/run/watches.h"

#include <algorithm>
#include <cmath>

#include "core/base/message.h"
#include "core/base/parallel.h"

namespace stellate::core {
namespace {

// A manifold leaves a box that is merely too small by a part of its size; one that goes on outside
// for as much as the box's diagonal has most likely no end.
constexpr double kBoxDiagonals = 1;
// This many rounds, times k, without a step of the front must leave no more than this share of the
// violations at their beginning. Runs that converge need a few dozen in all.
constexpr std::uint64_t kPatience = 100;
constexpr double kShareLeft = 0.75;
// Rounds on faces that break more than they fix end sooner: when violations are as many times those
// at the beginning, and have not fallen to kShareLeft of their most for this many rounds, times k.
// The longest such growth of a run that converged was 14 rounds.
constexpr std::uint64_t kPatienceWithGrowth = 25;
constexpr std::uint64_t kGrowth = 2;
// After as many rounds of any kind, a manifold bends too much for epsilon if this share of the
// stars does not close.
constexpr double kHopelessShare = 0.5;

}  // namespace

void BoxWatch::Look(const double* points, std::uint32_t count) {
  if (!box_) return;
  const auto d = static_cast<std::size_t>(box_->lower.size());
  const auto outside2 =
      ParallelGather<double>(count - looked_at_, [&](std::size_t at, auto* found) {
        const double* const p = points + (looked_at_ + at) * d;
        double away2 = 0;
        for (std::size_t i = 0; i < d; ++i) {
          const auto axis = static_cast<Eigen::Index>(i);
          const double beyond = std::max({box_->lower[axis] - p[i], p[i] - box_->upper[axis], 0.0});
          away2 += beyond * beyond;
        }
        if (away2 > 0) found->push_back(away2);
      });
  looked_at_ = count;
  for (const double away2 : outside2) {
    outside_ += away2 > epsilon_ * epsilon_;
    farthest_outside_ = std::max(farthest_outside_, std::sqrt(away2));
  }
}

bool BoxWatch::has_left() const {
  return box_ && farthest_outside_ > kBoxDiagonals * (box_->upper - box_->lower).norm();
}

std::string BoxWatch::WhyStopped() const {
  return Message(
      "the manifold leaves the bounding box and goes on for ", Brief(farthest_outside_),
      " beyond it, with ", outside_, " of ", looked_at_,
      " vertices outside. Is it open or unbounded? Cut it by walls, a box for instance "
      "(in Python keep=\"box\"), keep a component that is closed (keep=\"seeds\"), or give a "
      "box that holds all of it");
}

void BoxWatch::Warn(Certificate* certificate) const {
  if (outside_ == 0) return;
  certificate->warnings.push_back(
      Message("The manifold leaves the bounding box: ", outside_, " of ", looked_at_,
              " vertices lie outside, by up to ", Brief(farthest_outside_),
              ". Components outside of the box may have been missed; is the manifold open or "
              "unbounded? In Python keep=\"box\" keeps what lies in the box, keep=\"seeds\" the "
              "components that seeds lie on."));
}

bool StallWatch::HasStalled(std::uint64_t left, bool judges_all, bool is_last) {
  const bool progress =
      front_moved_ || static_cast<double>(left) <= kShareLeft * static_cast<double>(left_then_);
  // Slivers and inconsistencies are counted from when sizes and shapes first hold.
  const bool begins = judges_all && !judged_all_;
  judged_all_ = judges_all;
  front_moved_ = false;
  if (progress || begins) {
    left_then_ = left;
    rounds_since_ = 0;
  }
  const bool grows = HasGrown(left, progress || begins) && !is_last;
  return rounds_since_++ > kPatience * static_cast<std::uint64_t>(k_) || grows;
}

bool StallWatch::HasGrown(std::uint64_t left, bool progress) {
  if (progress || static_cast<double>(left) <= kShareLeft * static_cast<double>(growing_to_)) {
    growing_from_ = growing_to_ = left;
    rounds_growing_ = 0;
  }
  growing_to_ = std::max(growing_to_, left);
  return rounds_growing_++ > kPatienceWithGrowth * static_cast<std::uint64_t>(k_) &&
         left >= kGrowth * std::max<std::uint64_t>(growing_from_, 1);
}

bool StallWatch::ShouldLookForLostCauses() {
  if (front_moved_) rounds_since_front_ = 0;
  return ++rounds_since_front_ == kPatience;
}

bool StallWatch::IsHopeless(std::uint64_t bad, std::uint64_t stars) {
  return ++rounds_ > kPatience * static_cast<std::uint64_t>(k_) &&
         static_cast<double>(bad) > kHopelessShare * static_cast<double>(stars);
}

}  // namespace stellate::core
