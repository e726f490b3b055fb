#include "core/index/ball_tree.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <numeric>

#include "core/base/capacity.h"
#include "core/base/parallel.h"
#include "core/base/parallel_select.h"
#include "core/base/parallel_sort.h"
#include "core/base/unset.h"

namespace stellate::core {
namespace {

// Parted at the middle of its extent, no half holds less than one in so many of the points.
constexpr std::size_t kLeastShare = 16;
// Fewer points are not worth a second thread.
constexpr std::size_t kBuiltAlone = 512;
// So many are measured by all threads, and so many parted: that takes twice the work.
constexpr std::size_t kMeasuredAlone = 2048, kPartedAlone = 16384;

// The coordinate in which points extend farthest, and the middle between its ends.
struct Extent {
  std::size_t coordinate;
  double middle;
};

// Writes the box around points, d numbers each: `known`, or `any_d` if that is 0.
template <typename Known>
void Enclose(Known known, int any_d, const double* coordinates, const std::uint32_t* begin,
             const std::uint32_t* end, double* low, double* high) {
  const auto d = static_cast<std::size_t>(known() > 0 ? known() : any_d);
  std::copy_n(coordinates + *begin * d, d, low);
  std::copy_n(coordinates + *begin * d, d, high);
  for (const std::uint32_t* i = begin + 1; i != end; ++i) {
    const double* const x = coordinates + *i * d;
    for (std::size_t j = 0; j < d; ++j) {
      low[j] = std::min(low[j], x[j]);
      high[j] = std::max(high[j], x[j]);
    }
  }
}

// The same of many, in parallel.
template <typename Known>
void EncloseMany(Known known, int any_d, const double* coordinates, const std::uint32_t* begin,
                 const std::uint32_t* end, double* low, double* high) {
  const auto d = static_cast<std::size_t>(known() > 0 ? known() : any_d);
  const auto count = static_cast<std::size_t>(end - begin);
  std::vector<double> boxes(ChunkCount(count) * 2 * d);
  ParallelChunks(count, [&](std::size_t chunk, std::size_t from, std::size_t to) {
    double* const box = boxes.data() + chunk * 2 * d;
    Enclose(known, any_d, coordinates, begin + from, begin + to, box, box + d);
  });
  std::copy_n(boxes.data(), d, low);
  std::copy_n(boxes.data() + d, d, high);
  for (std::size_t at = 0; at < boxes.size(); at += 2 * d)
    for (std::size_t j = 0; j < d; ++j) {
      low[j] = std::min(low[j], boxes[at + j]);
      high[j] = std::max(high[j], boxes[at + d + j]);
    }
}

Extent WidestExtent(const double* coordinates, int any_d, const std::uint32_t* begin,
                    const std::uint32_t* end) {
  return WithDimension(any_d, [&](auto known) {
    const auto d = static_cast<std::size_t>(known() > 0 ? known() : any_d);
    std::vector<double> many(known() > 0 ? 0 : 2 * d);
    double few[known() > 0 ? 2 * known() : 1];
    double* const low = known() > 0 ? few : many.data();
    double* const high = low + d;
    if (static_cast<std::size_t>(end - begin) < kMeasuredAlone)
      Enclose(known, any_d, coordinates, begin, end, low, high);
    else
      EncloseMany(known, any_d, coordinates, begin, end, low, high);
    std::size_t widest = 0;
    for (std::size_t j = 1; j < d; ++j)
      if (high[j] - low[j] > high[widest] - low[widest]) widest = j;
    return Extent{widest, low[widest] + (high[widest] - low[widest]) / 2};
  });
}

// As std::partition, in the same order, in parallel if they are many: of those on the wrong side
// the first from either end change places, and so on.
template <typename Below>
std::uint32_t* PartPoints(std::uint32_t* begin, std::uint32_t* end, const Below& is_below) {
  const auto count = static_cast<std::size_t>(end - begin);
  if (count < kPartedAlone) return std::partition(begin, end, is_below);
  const auto below = ParallelSelect(count, [&](std::size_t i) { return is_below(begin[i]); });
  const std::size_t middle = below.size();
  const auto above = ParallelSelect(middle, [&](std::size_t i) { return !is_below(begin[i]); });
  ParallelFor(above.size(),
              [&](std::size_t i) { std::swap(begin[above[i]], begin[below[middle - 1 - i]]); });
  return begin + middle;
}

// Makes `most` at least `value`, for all threads at once.
void RaiseTo(double value, double* most) {
  const std::atomic_ref<double> shared(*most);
  double before = shared.load(std::memory_order_relaxed);
  while (before < value &&
         !shared.compare_exchange_weak(before, value, std::memory_order_relaxed)) {
  }
}

}  // namespace

std::uint32_t BallTree::NewNodes(int count) {
  const auto first = static_cast<std::uint32_t>(nodes_.size());
  const auto more = static_cast<std::size_t>(count), d = static_cast<std::size_t>(d_);
  ReserveMore(more, &nodes_);
  ReserveMore(more * d, &centres_);
  nodes_.resize(nodes_.size() + more);
  centres_.resize(nodes_.size() * d, 0.0);
  return first;
}

void BallTree::Mean(const std::uint32_t* begin, const std::uint32_t* end, double* mean) const {
  WithDimension(d_, [&](auto known) {
    const int d = known() > 0 ? known() : d_;
    double few[known() > 0 ? known() : 1];
    double* const sum = known() > 0 ? few : mean;
    std::fill(sum, sum + d, 0.0);
    for (const std::uint32_t* i = begin; i != end; ++i)
      for (int j = 0; j < d; ++j) sum[j] += Point(*i)[j];
    for (int j = 0; j < d; ++j) mean[j] = sum[j] / static_cast<double>(end - begin);
  });
}

// Centre, radius and outreach from the points themselves.
void BallTree::Measure(std::uint32_t node, const std::uint32_t* begin, const std::uint32_t* end) {
  double* c = Centre(node);
  Mean(begin, end, c);
  const auto measure = [&](std::size_t from, std::size_t to) {
    std::pair<double, double> most;  // radius and outreach
    WithDimension(d_, [&](auto known) {
      const int d = known() > 0 ? known() : d_;
      for (const std::uint32_t* i = begin + from; i != begin + to; ++i) {
        const double distance = Distance(c, Point(*i), d);
        most.first = std::max(most.first, distance);
        most.second = std::max(most.second, distance + influence_[*i]);
      }
    });
    return most;
  };
  const auto count = static_cast<std::size_t>(end - begin);
  std::pair<double, double> most;
  if (count < kMeasuredAlone) {
    most = measure(0, count);
  } else {
    ParallelChunks(count, [&](std::size_t, std::size_t from, std::size_t to) {
      const auto some = measure(from, to);
      RaiseTo(some.first, &most.first);
      RaiseTo(some.second, &most.second);
    });
  }
  nodes_[node].radius = most.first;
  nodes_[node].outreach = most.second;
}

void BallTree::MakeLeaf(std::uint32_t node, std::uint32_t first_slot, const std::uint32_t* begin,
                        const std::uint32_t* end) {
  nodes_[node].children = kNone;
  nodes_[node].first = first_slot;
  nodes_[node].count = static_cast<std::uint32_t>(end - begin);
  std::copy(begin, end, slots_.begin() + first_slot);
  for (const std::uint32_t* i = begin; i != end; ++i) leaf_of_[*i] = node;
}

// Returns where to divide them: at the middle of the coordinate in which they extend farthest,
// unless that would leave hardly any on one side, or by their number, along the line through two
// far ones.
std::uint32_t* BallTree::Middle(std::uint32_t* begin, std::uint32_t* end, Halving halving) const {
  const auto count = static_cast<std::size_t>(end - begin);
  if (halving == Halving::kExtent) {
    const Extent widest = WidestExtent(coordinates_->data(), d_, begin, end);
    const double* const along = coordinates_->data() + widest.coordinate;
    const auto stride = static_cast<std::size_t>(d_);
    std::uint32_t* const middle =
        PartPoints(begin, end, [&](std::uint32_t i) { return along[i * stride] < widest.middle; });
    const auto below = static_cast<std::size_t>(middle - begin);
    if (kLeastShare * std::min(below, count - below) >= count) return middle;
  }
  thread_local std::vector<double> axis;
  axis.resize(static_cast<std::size_t>(d_));
  Mean(begin, end, axis.data());
  // Memory of the small ones, which are many, is used again.
  using Along = std::vector<std::pair<double, std::uint32_t>>;
  thread_local Along kept;
  Along own;
  Along& along = count < kBuiltAlone ? kept : own;
  along.resize(count);
  WithDimension(d_, [&](auto known) {
    const int d = known() > 0 ? known() : d_;
    const auto farthest = [&](const double* from) {
      const std::uint32_t* best = begin;
      double most2 = -1;
      for (const std::uint32_t* i = begin; i != end; ++i) {
        const double s = SquaredDistance(from, Point(*i), d);
        if (s > most2) {
          most2 = s;
          best = i;
        }
      }
      return Point(*best);
    };
    const double* a = farthest(axis.data());
    const double* b = farthest(a);
    double* const line = axis.data();
    for (int j = 0; j < d; ++j) line[j] = b[j] - a[j];
    for (std::size_t i = 0; i < count; ++i) along[i] = {Dot(line, Point(begin[i]), d), begin[i]};
  });
  const auto middle = along.begin() + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(along.begin(), middle, along.end());
  for (std::size_t i = 0; i < count; ++i) begin[i] = along[i].second;
  return begin + count / 2;
}

std::unique_ptr<BallTree::Halves> BallTree::Halve(std::uint32_t* begin, std::uint32_t* end,
                                                  Halving halving) const {
  auto halves = std::make_unique<Halves>();
  const auto count = static_cast<std::size_t>(end - begin);
  if (count <= kBuiltLeaf) return halves;
  halves->middle = Middle(begin, end, halving);
  const auto halve = [&](int half) {
    (half == 0 ? halves->first : halves->second) =
        half == 0 ? Halve(begin, halves->middle, halving) : Halve(halves->middle, end, halving);
  };
  if (count < kBuiltAlone) {
    halve(0);
    halve(1);
  } else {
    ParallelFor(2, halve);
  }
  halves->leaves = halves->first->leaves + halves->second->leaves;
  return halves;
}

// The nodes below take the places from `place.node` on, the leaves the slots from `place.slot` on:
// where each goes is known before any is there, and large halves are built in parallel.
void BallTree::Build(std::uint32_t node, Place place, std::uint32_t* begin, std::uint32_t* end,
                     const Halves& halves) {
  Measure(node, begin, end);
  if (halves.middle == nullptr) return MakeLeaf(node, place.slot, begin, end);
  const std::uint32_t children = place.node;
  nodes_[node].children = children;
  nodes_[children].parent = nodes_[children + 1].parent = node;
  const std::uint32_t leaves = halves.first->leaves;
  const Place left{place.node + 2, place.slot};
  const Place right{left.node + 2 * (leaves - 1), place.slot + leaves * kLeafCapacity};
  const auto build = [&](int child) {
    child == 0 ? Build(children, left, begin, halves.middle, *halves.first)
               : Build(children + 1, right, halves.middle, end, *halves.second);
  };
  if (static_cast<std::size_t>(end - begin) < kBuiltAlone) {
    build(0);
    build(1);
  } else {
    ParallelFor(2, build);
  }
}

void BallTree::Rebuild(Halving halving) {
  built_ = influence_.size();
  stale_.clear();
  UnsetVector<std::uint32_t> ids(built_);
  ParallelRanges(built_, [&](std::size_t begin, std::size_t end) {
    std::iota(ids.data() + begin, ids.data() + end, static_cast<std::uint32_t>(begin));
  });
  const std::unique_ptr<Halves> halves = Halve(ids.data(), ids.data() + ids.size(), halving);
  nodes_.assign(2 * std::size_t{halves->leaves} - 1, {});
  centres_.assign(nodes_.size() * static_cast<std::size_t>(d_), 0.0);
  slots_.resize(std::size_t{halves->leaves} * kLeafCapacity);
  Build(0, {1, 0}, ids.data(), ids.data() + ids.size(), *halves);
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
  ReserveMore(kLeafCapacity, &slots_);
  slots_.resize(slots_.size() + kLeafCapacity);
  MakeLeaf(children + 1, slot, half, ids + kLeafCapacity);
}

void BallTree::Assign(std::vector<double> influences, Halving halving) {
  influence_ = std::move(influences);
  leaf_of_.assign(influence_.size(), 0);
  if (influence_.empty())
    nodes_.clear();
  else
    Rebuild(halving);
}

void BallTree::FitCapacity(std::size_t parts) {
  core::FitCapacity(parts, &influence_);
  core::FitCapacity(parts, &leaf_of_);
  core::FitCapacity(parts, &nodes_);
  core::FitCapacity(parts, &centres_);
  core::FitCapacity(parts, &slots_);
}

// Children have larger numbers than their parents.
void BallTree::SetInfluences(std::vector<double> influences) {
  influence_ = std::move(influences);
  stale_.clear();
  ParallelFor(nodes_.size(), [&](std::size_t n) {
    if (nodes_[n].children == kNone) MeasureOutreach(static_cast<std::uint32_t>(n));
  });
  for (std::size_t n = nodes_.size(); n-- > 0;) {
    CheckInterruption(n);
    Node& node = nodes_[n];
    if (node.children != kNone) node.outreach = OutreachOfChildren(static_cast<std::uint32_t>(n));
  }
}

void BallTree::MeasureOutreach(std::uint32_t leaf) {
  double outreach = 0;
  for (std::uint32_t i = 0; i < nodes_[leaf].count; ++i) {
    const std::uint32_t id = slots_[nodes_[leaf].first + i];
    outreach = std::max(outreach, Distance(Centre(leaf), Point(id), d_) + influence_[id]);
  }
  nodes_[leaf].outreach = outreach;
}

double BallTree::OutreachOfChildren(std::uint32_t n) const {
  const std::uint32_t a = nodes_[n].children;
  double outreach = 0;
  for (std::uint32_t c = a; c <= a + 1; ++c)
    outreach = std::max(outreach, Distance(Centre(n), Centre(c), d_) + nodes_[c].outreach);
  return outreach;
}

void BallTree::Insert(double influence) {
  const auto id = static_cast<std::uint32_t>(influence_.size());
  ReserveMore(1, &influence_);
  ReserveMore(1, &leaf_of_);
  influence_.push_back(influence);
  leaf_of_.push_back(0);
  if (nodes_.empty() || influence_.size() > kRebuild * built_ + 32) {
    Rebuild(Halving::kNumber);
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
  ParallelFor(stale_.size(), [&](std::size_t i) {
    // One that has been split since was measured then.
    if (nodes_[stale_[i]].children == kNone) MeasureOutreach(stale_[i]);
  });
  std::size_t steps = 0;
  for (const std::uint32_t leaf : stale_) {
    CheckInterruption(steps++);
    if (nodes_[leaf].children != kNone) continue;
    for (std::uint32_t n = nodes_[leaf].parent; n != kNone; n = nodes_[n].parent) {
      const double outreach = OutreachOfChildren(n);
      if (outreach >= nodes_[n].outreach) break;  // already as tight as the children allow
      nodes_[n].outreach = outreach;
    }
  }
  stale_.clear();
}

}  // namespace stellate::core
