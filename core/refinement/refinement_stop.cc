// What would go on without end: a manifold that leaves the client's box, and rounds that mend as
// much as they break.

#include <algorithm>
#include <cmath>

#include "core/base/message.h"
#include "core/refinement/refinement.h"

namespace stellate::core {
namespace {

// A box that is merely too small is left by a part of its size; what goes on for as much as its
// diagonal on the outside has most likely no end.
constexpr double kBoxDiagonals = 1;
// So many rounds, times k, without a step of the front into unknown ground must leave no more than
// this share of the violations that there were. Runs that converge need a few dozen in all.
constexpr std::uint64_t kPatience = 100;
constexpr double kShareLeft = 0.75;

}  // namespace

template <int K>
bool Refinement<K>::HasLeftBox() {
  if (rehearsal_ || !spec_.bounding_box) return false;
  const BoundingBox& box = *spec_.bounding_box;
  for (; boxed_ < complex_.size(); ++boxed_) {
    const double* p = complex_.Point(boxed_);
    double outside2 = 0;
    for (int i = 0; i < complex_.d(); ++i) {
      const double beyond = std::max({box.lower[i] - p[i], p[i] - box.upper[i], 0.0});
      outside2 += beyond * beyond;
    }
    outside_box_ += outside2 > criteria_.epsilon * criteria_.epsilon;
    farthest_outside_ = std::max(farthest_outside_, std::sqrt(outside2));
  }
  return farthest_outside_ > kBoxDiagonals * (box.upper - box.lower).norm();
}

// Whether the last rounds have mended little that their own points did not break again.
template <int K>
bool Refinement<K>::HasStalled() {
  if (rehearsal_) return false;
  const std::uint64_t left = active_.size() + blemished_.size();
  const bool progress =
      front_moved_ || static_cast<double>(left) <= kShareLeft * static_cast<double>(left_then_);
  // Slivers and inconsistencies are counted from when sizes and shapes first hold.
  const bool begins = judges_all_ && !all_suspect_;
  judges_all_ = all_suspect_;
  front_moved_ = false;
  if (progress || begins) {
    left_then_ = left;
    stalled_rounds_ = 0;
  }
  return stalled_rounds_++ > kPatience * K;
}

template <int K>
std::string Refinement<K>::WhyStopped() const {
  if (spec_.bounding_box &&
      farthest_outside_ >
          kBoxDiagonals * (spec_.bounding_box->upper - spec_.bounding_box->lower).norm())
    return Message("the manifold leaves the bounding box and goes on for ",
                   Brief(farthest_outside_), " beyond it, with ", outside_box_, " of ",
                   complex_.size(),
                   " vertices outside. Is it open or unbounded? Only closed manifolds are meshed: "
                   "bound it, or, if it is closed, give a box that holds all of it");
  return WhatIsLeft();
}

template <int K>
void Refinement<K>::WarnOfBox(Certificate* certificate) const {
  if (outside_box_ == 0) return;
  certificate->warnings.push_back(
      Message("The manifold leaves the bounding box: ", outside_box_, " of ", complex_.size(),
              " vertices lie outside, by up to ", Brief(farthest_outside_),
              ". Components outside of the box may have been missed; is the manifold open or "
              "unbounded?"));
}

#define STELLATE_INSTANTIATE(K)                           \
  template bool Refinement<K>::HasLeftBox();              \
  template bool Refinement<K>::HasStalled();              \
  template std::string Refinement<K>::WhyStopped() const; \
  template void Refinement<K>::WarnOfBox(Certificate*) const;
STELLATE_INSTANTIATE(1)
STELLATE_INSTANTIATE(2)
STELLATE_INSTANTIATE(3)
STELLATE_INSTANTIATE(4)
STELLATE_INSTANTIATE(5)
#undef STELLATE_INSTANTIATE

}  // namespace stellate::core
