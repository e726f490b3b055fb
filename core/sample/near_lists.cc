#include "core/sample/near_lists.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "core/base/parallel.h"
#include "core/sample/ball_tree.h"

namespace stellate::core {
namespace {

// Points in the order of their places, and where each place begins.
struct Bunches {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> members;  // place, point
  std::vector<std::size_t> begins;                               // and the end, at the end

  Bunches(const BallTree& tree, std::size_t count) : members(count) {
    ParallelFor(count, [&](std::size_t i) {
      const auto id = static_cast<std::uint32_t>(i);
      members[i] = {tree.PlaceOf(id), id};
    });
    ParallelSort(members, std::less<>());
    for (std::size_t i = 0; i < count; ++i) {
      CheckInterruption(i);
      if (i == 0 || members[i].first != members[i - 1].first) begins.push_back(i);
    }
    begins.push_back(count);
  }
  std::size_t size() const { return begins.size() - 1; }
};

}  // namespace

// One search a bunch of points, instead of one a point.
NearLists::NearLists(const std::vector<double>& points, int d, double radius)
    : spans_(points.size() / static_cast<std::size_t>(d)) {
  BallTree tree(d, &points);
  tree.Assign(std::vector<double>(spans_.size(), 0.0));
  const Bunches bunches(tree, spans_.size());
  lists_.resize(ChunkCount(bunches.size()));
  const auto at = [&](std::uint32_t i) { return points.data() + i * static_cast<std::size_t>(d); };
  ParallelChunks(bunches.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t>& list = lists_[chunk];
    std::vector<std::uint32_t> around;
    for (std::size_t b = begin; b < end; ++b) {
      const auto* const first = bunches.members.data() + bunches.begins[b];
      const auto* const last = bunches.members.data() + bunches.begins[b + 1];
      const double* const centre = at(first->second);
      double reach = 0;
      for (const auto* m = first; m != last; ++m)
        reach = std::max(reach, Distance(centre, at(m->second), d));
      around.clear();
      tree.VisitNear(
          centre, [&] { return reach + radius; },
          [&](std::uint32_t j, double) { around.push_back(j); });
      std::sort(around.begin(), around.end());
      for (const auto* m = first; m != last; ++m) {
        const std::uint32_t i = m->second;
        const auto from = static_cast<std::uint32_t>(list.size());
        for (const std::uint32_t j : around)
          if (j != i && SquaredDistance(at(i), at(j), d) < radius * radius) list.push_back(j);
        spans_[i] = {static_cast<std::uint32_t>(chunk), from,
                     static_cast<std::uint32_t>(list.size()) - from};
      }
    }
  });
}

}  // namespace stellate::core
