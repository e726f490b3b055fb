#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {

// What would go on without end: a manifold that leaves the client's box, and rounds that mend as
// much as they break.

class BoxWatch {
 public:
  BoxWatch(const std::optional<BoundingBox>& box, double epsilon) : box_(box), epsilon_(epsilon) {}

  // Looks at the vertices that came since the last call, of all `count`, d numbers each.
  void Look(const double* points, std::uint32_t count);
  // Whether they go on outside for longer than a box that is merely too small explains.
  bool has_left() const;
  // That, for people. REQUIRES: has_left().
  std::string WhyStopped() const;
  // Warns of vertices outside.
  void Warn(Certificate* certificate) const;

 private:
  const std::optional<BoundingBox> box_;
  double epsilon_;
  std::uint32_t looked_at_ = 0;  // vertices
  std::uint64_t outside_ = 0;    // those that lie outside by more than epsilon
  double farthest_outside_ = 0;  // length
};

class StallWatch {
 public:
  explicit StallWatch(int k) : k_(k) {}

  // A star on the advancing front was mended since the last round.
  void NoteFrontMoved() { front_moved_ = true; }
  // Whether the last rounds have mended little that their own points did not break again. Called
  // once a round: `left` violations are known, and of R3 and R4 only if `judges_all`.
  bool HasStalled(std::uint64_t left, bool judges_all);
  // Whether after many rounds most of the `stars` still break R1 or R2, `bad` of them: a front
  // would be a small part of the mesh by then. Called once a round.
  bool IsHopeless(std::uint64_t bad, std::uint64_t stars);
  // True once where so many rounds have passed without a step of the front, whatever they mended,
  // that what can never be mended should be looked for. Called once a round, before HasStalled.
  bool ShouldLookForLostCauses();

 private:
  int k_;
  bool front_moved_ = false;
  bool judged_all_ = false;                      // in the round before
  std::uint64_t left_then_ = ~std::uint64_t{0};  // violations, at the last progress
  std::uint64_t rounds_since_ = 0;
  std::uint64_t rounds_since_front_ = 0;
  std::uint64_t rounds_ = 0;
};

}  // namespace stellate::core
