#include "core/sample/ball_tree.h"

#include <algorithm>
#include <numeric>

namespace stellate::core {

std::uint32_t BallTree::NewNodes(int count) {
  const auto first = static_cast<std::uint32_t>(nodes_.size());
  nodes_.resize(nodes_.size() + static_cast<std::size_t>(count));
  centres_.resize(nodes_.size() * static_cast<std::size_t>(d_), 0.0);
  return first;
}

// Centre, radius and outreach from the points themselves.
void BallTree::Measure(std::uint32_t node, const std::uint32_t* begin, const std::uint32_t* end) {
  double* c = Centre(node);
  std::fill(c, c + d_, 0.0);
  for (const std::uint32_t* i = begin; i != end; ++i)
    for (int j = 0; j < d_; ++j) c[j] += Point(*i)[j];
  for (int j = 0; j < d_; ++j) c[j] /= static_cast<double>(end - begin);
  double radius = 0, outreach = 0;
  for (const std::uint32_t* i = begin; i != end; ++i) {
    const double distance = Distance(c, Point(*i), d_);
    radius = std::max(radius, distance);
    outreach = std::max(outreach, distance + influence_[*i]);
  }
  nodes_[node].radius = radius;
  nodes_[node].outreach = outreach;
}

void BallTree::MakeLeaf(std::uint32_t node, const std::uint32_t* begin, const std::uint32_t* end) {
  const auto first = static_cast<std::uint32_t>(slots_.size());
  slots_.resize(slots_.size() + kLeafCapacity);
  nodes_[node].children = kNone;
  nodes_[node].first = first;
  nodes_[node].count = static_cast<std::uint32_t>(end - begin);
  std::copy(begin, end, slots_.begin() + first);
  for (const std::uint32_t* i = begin; i != end; ++i) leaf_of_[*i] = node;
}

// Halves along the line through two far points, down to leaves two thirds full.
void BallTree::Build(std::uint32_t node, std::uint32_t* begin, std::uint32_t* end) {
  Measure(node, begin, end);
  if (end - begin <= kLeafCapacity * 2 / 3) {
    MakeLeaf(node, begin, end);
    return;
  }
  const auto farthest = [&](const double* from) {
    const std::uint32_t* best = begin;
    double most = -1;
    for (const std::uint32_t* i = begin; i != end; ++i) {
      const double s = SquaredDistance(from, Point(*i), d_);
      if (s > most) {
        most = s;
        best = i;
      }
    }
    return Point(*best);
  };
  const double* a = farthest(Centre(node));
  const double* b = farthest(a);
  std::vector<double> axis(static_cast<std::size_t>(d_));
  for (int j = 0; j < d_; ++j) axis[static_cast<std::size_t>(j)] = b[j] - a[j];
  std::vector<std::pair<double, std::uint32_t>> along;
  along.reserve(static_cast<std::size_t>(end - begin));
  for (const std::uint32_t* i = begin; i != end; ++i)
    along.emplace_back(Dot(axis.data(), Point(*i), d_), *i);
  const auto middle = along.begin() + static_cast<std::ptrdiff_t>(along.size() / 2);
  std::nth_element(along.begin(), middle, along.end());
  for (std::size_t i = 0; i < along.size(); ++i) begin[i] = along[i].second;
  std::uint32_t* half = begin + along.size() / 2;
  along = {};
  const std::uint32_t children = NewNodes(2);
  nodes_[node].children = children;
  nodes_[children].parent = nodes_[children + 1].parent = node;
  Build(children, begin, half);
  Build(children + 1, half, end);
}

void BallTree::Rebuild() {
  built_ = influence_.size();
  nodes_.clear();
  centres_.clear();
  slots_.clear();
  stale_.clear();
  std::vector<std::uint32_t> ids(built_);
  std::iota(ids.begin(), ids.end(), 0u);
  NewNodes(1);
  Build(0, ids.data(), ids.data() + ids.size());
}

// A full leaf becomes two, each around one of two far points.
void BallTree::Split(std::uint32_t node) {
  const std::uint32_t first = nodes_[node].first;
  std::uint32_t ids[kLeafCapacity];
  std::copy_n(slots_.begin() + first, kLeafCapacity, ids);
  const auto farthest = [&](std::uint32_t from) {
    return *std::max_element(ids, ids + kLeafCapacity, [&](std::uint32_t x, std::uint32_t y) {
      return SquaredDistance(Point(from), Point(x), d_) <
             SquaredDistance(Point(from), Point(y), d_);
    });
  };
  const std::uint32_t a = farthest(ids[0]);
  const std::uint32_t b = farthest(a);
  const auto middle = std::stable_partition(ids, ids + kLeafCapacity, [&](std::uint32_t i) {
    return SquaredDistance(Point(a), Point(i), d_) <= SquaredDistance(Point(b), Point(i), d_);
  });
  std::uint32_t* half = middle;
  if (half == ids || half == ids + kLeafCapacity) half = ids + kLeafCapacity / 2;  // all alike
  const std::uint32_t children = NewNodes(2);
  nodes_[node].children = children;
  nodes_[node].count = 0;
  nodes_[children].parent = nodes_[children + 1].parent = node;
  Measure(children, ids, half);
  Measure(children + 1, half, ids + kLeafCapacity);
  // The first child takes over the parent's slots.
  nodes_[children].first = first;
  nodes_[children].count = static_cast<std::uint32_t>(half - ids);
  std::copy(ids, half, slots_.begin() + first);
  for (std::uint32_t* i = ids; i != half; ++i) leaf_of_[*i] = children;
  MakeLeaf(children + 1, half, ids + kLeafCapacity);
}

void BallTree::Insert(double influence) {
  const auto id = static_cast<std::uint32_t>(influence_.size());
  influence_.push_back(influence);
  leaf_of_.push_back(0);
  if (nodes_.empty() || influence_.size() > kRebuild * built_ + 32) {
    Rebuild();
    return;
  }
  const double* p = Point(id);
  std::uint32_t n = 0;
  double distance = Distance(p, Centre(0), d_);
  while (true) {
    Node& node = nodes_[n];
    node.radius = std::max(node.radius, distance);
    node.outreach = std::max(node.outreach, distance + influence);
    if (node.children == kNone) break;
    const std::uint32_t a = node.children;
    const double da = Distance(p, Centre(a), d_);
    const double db = Distance(p, Centre(a + 1), d_);
    n = da <= db ? a : a + 1;
    distance = std::min(da, db);
  }
  Node& leaf = nodes_[n];
  slots_[leaf.first + leaf.count++] = id;
  leaf_of_[id] = n;
  if (leaf.count == kLeafCapacity) Split(n);
}

std::vector<std::uint32_t> BallTree::SpatialOrder() const {
  std::vector<std::uint32_t> order;
  order.reserve(size());
  std::vector<std::uint32_t> stack;
  if (!nodes_.empty()) stack.push_back(0);
  while (!stack.empty()) {
    const Node& node = nodes_[stack.back()];
    stack.pop_back();
    if (node.children == kNone) {
      order.insert(order.end(), slots_.begin() + node.first,
                   slots_.begin() + node.first + node.count);
    } else {
      stack.push_back(node.children + 1);
      stack.push_back(node.children);
    }
  }
  return order;
}

void BallTree::SetInfluence(std::uint32_t id, double influence) {
  const bool grows = influence > influence_[id];
  influence_[id] = influence;
  if (!grows) {
    stale_.push_back(leaf_of_[id]);
    return;
  }
  for (std::uint32_t n = leaf_of_[id]; n != kNone; n = nodes_[n].parent) {
    const double reach = Distance(Centre(n), Point(id), d_) + influence;
    nodes_[n].outreach = std::max(nodes_[n].outreach, reach);
  }
}

void BallTree::Refit() {
  std::sort(stale_.begin(), stale_.end());
  stale_.erase(std::unique(stale_.begin(), stale_.end()), stale_.end());
  for (const std::uint32_t leaf : stale_) {
    if (nodes_[leaf].children != kNone) continue;  // split since: measured then
    double outreach = 0;
    for (std::uint32_t i = 0; i < nodes_[leaf].count; ++i) {
      const std::uint32_t id = slots_[nodes_[leaf].first + i];
      outreach = std::max(outreach, Distance(Centre(leaf), Point(id), d_) + influence_[id]);
    }
    nodes_[leaf].outreach = outreach;
    for (std::uint32_t n = nodes_[leaf].parent; n != kNone; n = nodes_[n].parent) {
      const std::uint32_t a = nodes_[n].children;
      double bound = 0;
      for (std::uint32_t c = a; c <= a + 1; ++c)
        bound = std::max(bound, Distance(Centre(n), Centre(c), d_) + nodes_[c].outreach);
      if (bound >= nodes_[n].outreach) break;  // already as tight as the children allow
      nodes_[n].outreach = bound;
    }
  }
  stale_.clear();
}

}  // namespace stellate::core
