#include "core/sample/ball_tree.h"

#include <algorithm>
#include <functional>
#include <numeric>

#include "core/base/parallel.h"

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

void BallTree::MakeLeaf(std::uint32_t node, std::uint32_t first_slot, const std::uint32_t* begin,
                        const std::uint32_t* end) {
  nodes_[node].children = kNone;
  nodes_[node].first = first_slot;
  nodes_[node].count = static_cast<std::uint32_t>(end - begin);
  std::copy(begin, end, slots_.begin() + first_slot);
  for (const std::uint32_t* i = begin; i != end; ++i) leaf_of_[*i] = node;
}

// How many leaves a balanced tree of that many points has.
std::uint32_t BallTree::LeafCount(std::size_t points) {
  if (points <= kBuiltLeaf) return 1;
  if (points % 2 == 0) return 2 * LeafCount(points / 2);
  return LeafCount(points / 2) + LeafCount(points - points / 2);
}

// Halves along the line through two far points. The nodes below take the places from `place.node`
// on, the leaves the slots from `place.slot` on: where each goes is known before any is there, and
// large halves are built in parallel.
void BallTree::Build(std::uint32_t node, Place place, std::uint32_t* begin, std::uint32_t* end) {
  Measure(node, begin, end);
  const auto count = static_cast<std::size_t>(end - begin);
  if (count <= kBuiltLeaf) return MakeLeaf(node, place.slot, begin, end);
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
  along.reserve(count);
  for (const std::uint32_t* i = begin; i != end; ++i)
    along.emplace_back(Dot(axis.data(), Point(*i), d_), *i);
  const auto middle = along.begin() + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(along.begin(), middle, along.end());
  for (std::size_t i = 0; i < count; ++i) begin[i] = along[i].second;
  along = {};
  std::uint32_t* const half = begin + count / 2;
  const std::uint32_t children = place.node;
  nodes_[node].children = children;
  nodes_[children].parent = nodes_[children + 1].parent = node;
  const std::uint32_t leaves = LeafCount(count / 2);
  const Place left{place.node + 2, place.slot};
  const Place right{left.node + 2 * (leaves - 1), place.slot + leaves * kLeafCapacity};
  const auto build = [&](int child) {
    child == 0 ? Build(children, left, begin, half) : Build(children + 1, right, half, end);
  };
  if (count < kBuiltAlone) {
    build(0);
    build(1);
  } else {
    ParallelFor(2, build);
  }
}

void BallTree::Rebuild() {
  built_ = influence_.size();
  stale_.clear();
  const std::uint32_t leaves = LeafCount(built_);
  nodes_.assign(2 * std::size_t{leaves} - 1, {});
  centres_.assign(nodes_.size() * static_cast<std::size_t>(d_), 0.0);
  slots_.resize(std::size_t{leaves} * kLeafCapacity);
  std::vector<std::uint32_t> ids(built_);
  std::iota(ids.begin(), ids.end(), 0u);
  Build(0, {1, 0}, ids.data(), ids.data() + ids.size());
  built_nodes_ = nodes_.size();
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
  const auto slot = static_cast<std::uint32_t>(slots_.size());
  slots_.resize(slots_.size() + kLeafCapacity);
  MakeLeaf(children + 1, slot, half, ids + kLeafCapacity);
}

void BallTree::Assign(std::vector<double> influences) {
  influence_ = std::move(influences);
  leaf_of_.assign(influence_.size(), 0);
  if (influence_.empty())
    nodes_.clear();
  else
    Rebuild();
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
  ParallelSort(stale_, std::less<>());
  stale_.erase(std::unique(stale_.begin(), stale_.end()), stale_.end());
  std::size_t steps = 0;
  for (const std::uint32_t leaf : stale_) {
    CheckInterruption(steps++);
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
