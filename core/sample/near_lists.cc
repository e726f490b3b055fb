#include "core/sample/near_lists.h"

#include <algorithm>

#include "core/base/parallel.h"
#include "core/sample/runs.h"

namespace stellate::core {
namespace {

// The points of a run lie within so many radii of its first.
constexpr double kReach = 4;

}  // namespace

// One search a run, and then point by point.
NearLists::NearLists(const std::vector<double>& points, int d, double radius)
    : spans_(points.size() / static_cast<std::size_t>(d)) {
  const RunTree tree(points, d, kReach * radius);
  const Runs& runs = tree.runs();
  lists_.resize(ChunkCount(runs.count()));
  const auto at = [&](std::size_t i) { return points.data() + i * static_cast<std::size_t>(d); };
  ParallelChunks(runs.count(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t>& list = lists_[chunk];
    std::vector<std::uint32_t> around;
    for (std::size_t run = begin; run < end; ++run) {
      around.clear();
      tree.Gather(runs.centre(run), runs.radius(run) + radius, &around);
      std::sort(around.begin(), around.end());
      for (std::size_t i = runs.begin(run); i < runs.end(run); ++i) {
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
