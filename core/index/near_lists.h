#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/unset.h"

namespace stellate::core {

// Lists, for each of many points, the others that are near it. Built in parallel; the same for any
// number of threads.
class NearLists {
 public:
  // `points`: d each. Two points are near if their distance is below `radius`, times the smaller of
  // their `shares` if these are given (one a point).
  NearLists(std::span<const double> points, int d, double radius,
            std::span<const double> shares = {});

  std::size_t size() const { return spans_.size(); }
  // Ascending; i is not among them.
  std::span<const std::uint32_t> Of(std::size_t i) const {
    const Span& s = spans_[i];
    return {lists_[s.list].data() + s.begin, s.count};
  }

 private:
  struct Span {
    std::uint32_t list, begin, count;
  };
  std::vector<std::vector<std::uint32_t>> lists_;
  UnsetVector<Span> spans_;  // by point
};

}  // namespace stellate::core
