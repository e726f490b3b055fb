#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {

// Detects a manifold that leaves the client's box, which a run would follow without end.
class BoxWatch {
 public:
  BoxWatch(const std::optional<BoundingBox>& box, double epsilon) : box_(box), epsilon_(epsilon) {}

  // Takes all `count` vertices, d numbers each, and looks at those that are new since the last
  // call.
  void Look(const double* points, std::uint32_t count);
  // Whether the vertices outside are more than a box that is merely too small explains.
  bool has_left() const;
  // Explains it, for people. REQUIRES: has_left().
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

// Detects a run that would not end because its rounds break as many simplices as they fix, or more.
class StallWatch {
 public:
  explicit StallWatch(int k) : k_(k) {}

  // Call it when a star on the advancing front was fixed since the last round.
  void NoteFrontMoved() { front_moved_ = true; }
  // Whether the last rounds have fixed little that their own points did not break again. Call it
  // once a round. `left`: known violations; of R3 and R4 only if `judges_all`. Where others are
  // left to do after these (not `is_last`), nor may rounds break more and more.
  bool HasStalled(std::uint64_t left, bool judges_all, bool is_last = true);
  // Whether after many rounds most of the `stars` still break R1 or R2 (`bad` of them): a front
  // would be a small part of the mesh by then. Call it once a round.
  bool IsHopeless(std::uint64_t bad, std::uint64_t stars);
  // True once so many rounds have passed without a step of the front that violations that cannot be
  // fixed should be searched for. Call it once a round, before HasStalled.
  bool ShouldLookForLostCauses();

 private:
  // Whether `left` has grown since it last fell, or there was progress, for too many rounds.
  bool HasGrown(std::uint64_t left, bool progress);

  int k_;
  bool front_moved_ = false;
  bool judged_all_ = false;                      // in the round before
  std::uint64_t left_then_ = ~std::uint64_t{0};  // violations, at the last progress
  std::uint64_t rounds_since_ = 0;
  std::uint64_t growing_from_ = 0, growing_to_ = 0;  // violations: at the last fall, most since
  std::uint64_t rounds_growing_ = 0;
  std::uint64_t rounds_since_front_ = 0;
  std::uint64_t rounds_ = 0;
};

}  // namespace stellate::core
