#include "core/sample/near_lists.h"

#include <algorithm>

#include "core/base/parallel.h"
#include "core/sample/ball_tree.h"

namespace stellate::core {

// One search a bunch of points, instead of one a point.
NearLists::NearLists(const std::vector<double>& points, int d, double radius)
    : spans_(points.size() / static_cast<std::size_t>(d)) {
  BallTree tree(d, &points);
  tree.Assign(std::vector<double>(spans_.size(), 0.0), BallTree::Halving::kExtent);
  const std::vector<BallTree::Bunch> bunches = tree.Bunches();
  lists_.resize(ChunkCount(bunches.size()));
  const auto at = [&](std::uint32_t i) { return points.data() + i * static_cast<std::size_t>(d); };
  ParallelChunks(bunches.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t>& list = lists_[chunk];
    std::vector<std::uint32_t> around;
    for (std::size_t b = begin; b < end; ++b) {
      const BallTree::Bunch& bunch = bunches[b];
      around.clear();
      tree.GatherAround(bunch, radius, &around);
      std::sort(around.begin(), around.end());
      for (std::uint32_t m = 0; m < bunch.count; ++m) {
        const std::uint32_t i = bunch.ids[m];
        const auto first = static_cast<std::uint32_t>(list.size());
        for (const std::uint32_t j : around)
          if (j != i && SquaredDistance(at(i), at(j), d) < radius * radius) list.push_back(j);
        spans_[i] = {static_cast<std::uint32_t>(chunk), first,
                     static_cast<std::uint32_t>(list.size()) - first};
      }
    }
  });
}

}  // namespace stellate::core
