#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/instantiate.h"
#include "core/complex/stars.h"
#include "core/refinement/violation_index.h"

namespace stellate::core {

// Rule R5 between rounds (core/rules/r5_protection.h): which stars have a weak simplex. It is
// judged once all other rules hold, and again where points came near. It is given up where points
// no longer help: a mesh is worth more.
//
//   Protection<2> protection(delta);
//   protection.Note(stars, changed, first);       // after each insertion
//   for (entry : protection.Judge(stars)) ...     // once all other rules hold
template <int K>
class Protection {
 public:
  using Entry = typename ViolationIndex<K>::Entry;

  Protection() = default;  // asks for nothing
  // delta: length; 0: asks for nothing.
  explicit Protection(double delta) : delta_(delta) {}

  bool is_asked() const { return delta_ > 0; }
  bool is_given_up() const { return is_given_up_; }
  double delta() const { return delta_; }
  // Stars with a weak simplex, as judged last.
  std::uint64_t weak() const { return weak_; }

  // Has those stars judged again that changed, or to whose simplices a new point may be near.
  // `changed`: their ids; `first`: the first new point.
  void Note(const Stars<K>& stars, const std::vector<std::uint32_t>& changed, std::uint32_t first);
  // Returns the violations that there are, one for each star, ascending. None, and from then on, if
  // it is given up. REQUIRES: no star breaks another rule.
  std::vector<Entry> Judge(const Stars<K>& stars);

 private:
  bool HasGoneTooFar(std::uint64_t vertices);

  double delta_ = 0;
  bool is_given_up_ = false;
  std::vector<std::uint8_t> is_protected_;  // by star: judged, and nothing has come near since
  std::uint64_t weak_ = 0;
  std::uint64_t vertices_before_ = 0;            // when it was judged first
  std::uint64_t fewest_ = 0, rounds_since_ = 0;  // weak stars, and rounds since they were so few
};

STELLATE_DECLARE_CLASS(Protection)

}  // namespace stellate::core
