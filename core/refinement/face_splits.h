#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/instantiate.h"
#include "core/refinement/engine_parts.h"
#include "core/refinement/target.h"

namespace stellate::core {

// R2 and R3 never split a boundary simplex below this share of the size bound. With a larger share
// shapes are bad where faces are near each other: of 63 gyroid solids that end just beside the
// corners of their boxes 12 do not close with this, 25 with 0.05, more than half with 0.25.
inline constexpr double kLeastSplit = 0.02;

// Whether a simplex of a wall of an arrangement breaks a rule and is left, for it is so small:
// where walls touch, each would cut the other's simplices without end.
template <int K>
bool IsLeftAlone(const Stars<K>& stars, const Violation<K>& violation, double size_bound) {
  return !stars.sample().sectors().labels().empty() && violation.walls != 0 &&
         violation.rule > Rule::kSize && violation.radius < kLeastSplit * size_bound;
}

// Decides where faces are split for the sake of others: an insertion yields to faces of lower
// dimension, as in Ruppert's refinement.
template <int K>
class FaceSplits {
 public:
  explicit FaceSplits(const EngineParts<K>& engine) : engine_(engine) {}

  // Returns the simplex dual to a vertex of a star's cell as a target, to be split although it
  // breaks no rule; nothing if it is too small already. by: the rule that it is split for.
  std::optional<Target<K>> Of(const typename Stars<K>::CellVertex& at, Rule by) const;

  // Returns a simplex of a wall to be split instead of a sliver on it, all of whose vertices are on
  // that wall, which may be flat, if no point near the sliver was good. The sliver's centre may be
  // on the wall itself, and points near it neither cut the sliver off nor encroach on the wall.
  std::optional<Target<K>> Under(std::uint32_t star, const Violation<K>& violation) const;

  // Whether a sliver has a vertex on a wall.
  bool IsSliverAtBoundary(std::uint32_t star, const Violation<K>& violation) const;

  // Replaces targets that would encroach on a face of lower dimension by splits of that face, and
  // adds the simplices that answers have encroached on. While faces of lower dimension have
  // targets, only R1 splits: beside a face that cannot be fixed, no shape ever could be, however
  // small.
  void Yield(std::vector<Target<K>>* targets);

 private:
  bool IsOnShell(const typename Stars<K>::FaceSimplex& simplex) const;

  EngineParts<K> engine_;
};

STELLATE_DECLARE_CLASS(FaceSplits)

}  // namespace stellate::core
