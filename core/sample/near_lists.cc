#include "core/sample/near_lists.h"

#include <algorithm>

#include "core/base/parallel.h"
#include "core/base/vector_ops.h"
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
  ParallelChunks(runs.count(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t>& list = lists_[chunk];
    std::vector<std::uint32_t> around;
    for (std::size_t run = begin; run < end; ++run) {
      around.clear();
      tree.Gather(runs.centre(run), runs.radius(run) + radius, &around);
      std::sort(around.begin(), around.end());
      WithDimension(d, [&](auto known) {
        const auto stride = static_cast<std::size_t>(known() > 0 ? known() : d);
        for (std::size_t i = runs.begin(run); i < runs.end(run); ++i) {
          const auto first = static_cast<std::uint32_t>(list.size());
          const double* const p = points.data() + i * stride;
          for (const std::uint32_t j : around)
            if (SquaredDistance(p, points.data() + j * stride, static_cast<int>(stride)) <
                    radius * radius &&
                j != i)
              list.push_back(j);
          spans_[i] = {static_cast<std::uint32_t>(chunk), first,
                       static_cast<std::uint32_t>(list.size()) - first};
        }
      });
    }
  });
}

}  // namespace stellate::core
