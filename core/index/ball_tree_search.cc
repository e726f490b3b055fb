// The searches of a ball tree.

#include <utility>
#include <vector>

#include "core/base/interruption.h"
#include "core/index/ball_tree.h"

namespace stellate::core {

std::vector<BallTree::Bunch> BallTree::Bunches() const {
  std::vector<Bunch> bunches;
  std::vector<std::uint32_t> open;
  if (!nodes_.empty()) open.push_back(0);
  for (std::size_t step = 0; !open.empty(); ++step) {
    CheckInterruption(step);
    const std::uint32_t n = open.back();
    const Node& node = nodes_[n];
    open.pop_back();
    if (node.children != kNone) {
      open.push_back(node.children + 1);
      open.push_back(node.children);
    } else if (node.count > 0) {
      bunches.push_back({slots_.data() + node.first, node.count, Centre(n), node.radius});
    }
  }
  return bunches;
}

std::pair<BallTree::Child, BallTree::Child> BallTree::Children(const Node& node,
                                                               const double* q) const {
  const std::uint32_t a = node.children;
  return WithDimension(d_, [&](auto known) {
    const int d = known() > 0 ? known() : d_;
    return std::pair{Child{a, SquaredDistance(q, Centre(a), d)},
                     Child{a + 1, SquaredDistance(q, Centre(a + 1), d)}};
  });
}

void BallTree::MeasureLeaf(const Node& leaf, const double* q, double* distance2) const {
  const std::uint32_t* const ids = slots_.data() + leaf.first;
  WithDimension(d_, [&](auto known) {
    const int d = known() > 0 ? known() : d_;
    for (std::uint32_t i = 0; i < leaf.count; ++i)
      distance2[i] = SquaredDistance(q, Point(ids[i]), d);
  });
}

// Along the tree, as recursion would go.
void BallTree::Gather(std::uint32_t n, const double* q, double radius,
                      std::vector<std::uint32_t>* ids) const {
  constexpr int kMostOpen = 64;
  WithDimension(d_, [&](auto known) {
    const int d = known() > 0 ? known() : d_;
    std::uint32_t open[kMostOpen] = {n};
    for (int count = 1; count > 0;) {
      const std::uint32_t at = open[--count];
      const Node& node = nodes_[at];
      const double far = kRounding * (radius + node.outreach);
      if (SquaredDistance(q, Centre(at), d) > far * far) continue;
      if (node.children != kNone && count + 2 > kMostOpen) {
        Gather(node.children, q, radius, ids);
        Gather(node.children + 1, q, radius, ids);
      } else if (node.children != kNone) {
        open[count++] = node.children + 1;
        open[count++] = node.children;
      } else {
        for (std::uint32_t i = 0; i < node.count; ++i) {
          const std::uint32_t id = slots_[node.first + i];
          const double reach = kRounding * (radius + influence_[id]);
          if (SquaredDistance(q, Point(id), d) <= reach * reach) ids->push_back(id);
        }
      }
    }
  });
}

}  // namespace stellate::core
