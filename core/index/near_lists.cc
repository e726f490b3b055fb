#include "core/index/near_lists.h"

#include <algorithm>

#include "core/base/parallel.h"
#include "core/base/vector_ops.h"
#include "core/index/runs.h"

namespace stellate::core {
namespace {

// The points of a run lie within so many radii of its first: more of them where distances cost
// little beside a search.
double ReachOfRuns(int d) { return d <= 3 ? 6 : 4; }

}  // namespace

// One search a run, and then point by point.
NearLists::NearLists(std::span<const double> points, int d, double radius,
                     std::span<const double> shares)
    : spans_(points.size() / static_cast<std::size_t>(d)) {
  const RunTree tree(points, d, ReachOfRuns(d) * radius, shares);
  const Runs& runs = tree.runs();
  lists_.resize(ChunkCount(runs.count()));
  ParallelChunks(runs.count(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    // Memory that grows is used again; what is kept is no larger than it must be.
    thread_local std::vector<std::uint32_t> around, list;
    list.clear();
    for (std::size_t run = begin; run < end; ++run) {
      double most = shares.empty() ? 1 : 0;
      for (std::size_t i = runs.begin(run); !shares.empty() && i < runs.end(run); ++i)
        most = std::max(most, shares[i]);
      around.clear();
      tree.Gather(runs.centre(run), runs.radius(run) + most * radius, &around);
      std::sort(around.begin(), around.end());
      WithDimension(d, [&](auto known) {
        const auto stride = static_cast<std::size_t>(known() > 0 ? known() : d);
        for (std::size_t i = runs.begin(run); i < runs.end(run); ++i) {
          const auto first = static_cast<std::uint32_t>(list.size());
          const double* const p = points.data() + i * stride;
          const double own = shares.empty() ? radius : radius * shares[i];
          for (const std::uint32_t j : around) {
            const double distance2 =
                SquaredDistance(p, points.data() + j * stride, static_cast<int>(stride));
            if (!(distance2 < own * own) || j == i) continue;
            const double others = shares.empty() ? own : radius * shares[j];
            if (distance2 < others * others) list.push_back(j);
          }
          spans_[i] = {static_cast<std::uint32_t>(chunk), first,
                       static_cast<std::uint32_t>(list.size()) - first};
        }
      });
    }
    lists_[chunk] = list;
  });
}

}  // namespace stellate::core
