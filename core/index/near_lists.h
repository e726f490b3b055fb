#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace stellate::core {

// Lists, for each of many points, the others that are near it. Built in parallel; the same for any
// number of threads.
class NearLists {
 public:
  // `points`: d each. Two points are near if their distance is below `radius`, times the smaller of
  // their `shares` if these are given (one a point).
  NearLists(const std::vector<double>& points, int d, double radius,
            const std::vector<double>& shares = {});

  std::size_t size() const { return spans_.size(); }
  // Ascending; i is not among them.
  std::span<const std::uint32_t> Of(std::size_t i) const {
    const Span& s = spans_[i];
    return {lists_[s.list].data() + s.begin, s.count};
  }

 private:
  struct Span {
    std::uint32_t list = 0, begin = 0, count = 0;
  };
  std::vector<std::vector<std::uint32_t>> lists_;
  std::vector<Span> spans_;  // by point
};

}  // namespace stellate::core
