#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace stellate::core {

// Cuts by what is near, nearest first and ties by id, out to where nothing can cut any more. `near`
// holds squared distances and who is there, sorted, and all there is within `known`; search(from,
// to) appends what lies between. Returns how far it knows all in the end.
template <typename Reach, typename Clip, typename Search>
double CutByNear(std::vector<std::pair<double, std::uint32_t>>* near, double known,
                 const Reach& reach, const Clip& clip, const Search& search) {
  for (std::size_t next = 0;;) {
    double far = reach();
    for (; next < near->size() && (*near)[next].first <= far * far; ++next)
      if (clip((*near)[next].second)) far = reach();
    if (far <= known) return known;
    const double farther = std::min(far, 2 * known);
    search(known, farther);
    std::sort(near->begin() + static_cast<std::ptrdiff_t>(next), near->end());
    known = farther;
  }
}

}  // namespace stellate::core
