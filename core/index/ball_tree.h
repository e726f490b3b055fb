#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "core/base/vector_ops.h"

namespace stellate::core {

// A spatial index of points of R^d, each with a radius of influence, for any d. Use it to find the
// stars that a new point can cut (influence 2 R_max), and the points near a point:
//
//   BallTree tree(d, &coordinates);
//   tree.Insert(influence);                     // the next point of `coordinates`
//   tree.Gather(q, radius, &ids);               // whose influence comes within radius of q
//   tree.ForEachInfluencing(q, [&](std::uint32_t id) { ... });
//
// It is a binary tree of balls over leaves of a few points. Each node has the ball around its
// points and its outreach, the largest distance from its centre at which one of its points has
// influence. It is rebuilt balanced whenever it has grown fourfold: O(log n) a point.
//
// Influences and radii are lengths, distances that visitors get are squared. Deterministic. Queries
// are const and may run in parallel.
class BallTree {
 public:
  // `coordinates` holds the points, d each, by id; borrowed, may grow and move between calls.
  BallTree(int d, const std::vector<double>* coordinates) : d_(d), coordinates_(coordinates) {}

  // Copies a tree, to search a copy of its points.
  BallTree(const BallTree& other, const std::vector<double>* coordinates) : BallTree(other) {
    coordinates_ = coordinates;
  }

  std::size_t size() const { return influence_.size(); }

  // Adds the point with the next id, size().
  void Insert(double influence);

  // How Assign halves points: by their number, so that insertion keeps the tree flat, or at the
  // middle of their extent, so that balls are as small as possible.
  enum class Halving { kNumber, kExtent };
  // Makes it the tree of the points 0 to influences.size() - 1, built in parallel.
  void Assign(std::vector<double> influences, Halving halving = Halving::kNumber);

  // Replaces all influences, by id.
  void SetInfluences(std::vector<double> influences);

  // The points of a leaf, and the ball around them.
  struct Bunch {
    const std::uint32_t* ids;
    std::uint32_t count;
    const double* centre;
    double radius;
  };
  // Every point is in one bunch; consecutive bunches are mostly near each other.
  std::vector<Bunch> Bunches() const;
  // Appends the points whose influence comes within `radius` of q, in a fixed but arbitrary order.
  // May append others that only rounding excludes. Without influence: the points within `radius`.
  void Gather(const double* q, double radius, std::vector<std::uint32_t>* ids) const {
    if (!nodes_.empty()) Gather(0, q, radius, ids);
  }
  // Appends at least the points within `radius` of some point of the bunch.
  void GatherAround(const Bunch& bunch, double radius, std::vector<std::uint32_t>* ids) const {
    Gather(bunch.centre, bunch.radius + radius, ids);
  }

  // Changes one influence. A larger one takes effect immediately; a smaller one makes searches
  // faster after Refit. The results are the same.
  void SetInfluence(std::uint32_t id, double influence);
  // Call it once after many calls of SetInfluence.
  void Refit();

  // Calls visit(id) for each point p with |q - p| < influence(p), in no meaningful but a fixed
  // order.
  template <typename Visit>
  void ForEachInfluencing(const double* q, Visit&& visit) const {
    if (nodes_.empty()) return;
    Influencing(0, SquaredDistance(q, Centre(0), d_), q, visit);
  }

  // Calls visit(id, squared distance) for the points within `radius()`, roughly nearest first.
  // `radius()` is called repeatedly, and may shrink meanwhile.
  template <typename Radius, typename Visit>
  void VisitNear(const double* q, Radius&& radius, Visit&& visit) const {
    if (nodes_.empty()) return;
    Near(0, SquaredDistance(q, Centre(0), d_), q, radius, visit);
  }

  // Both searches in one descent: near(id, squared distance) as VisitNear, influencing(id) as
  // ForEachInfluencing.
  template <typename Radius, typename Near, typename Influencing>
  void VisitAround(const double* q, Radius&& radius, Near&& near, Influencing&& influencing) const {
    if (nodes_.empty()) return;
    Around(0, SquaredDistance(q, Centre(0), d_), q, radius, near, influencing);
  }

  // Whether some point lies within `radius` of q.
  bool AnyWithin(const double* q, double radius) const {
    return !nodes_.empty() && AnyWithin(0, SquaredDistance(q, Centre(0), d_), q, radius);
  }

  // After Assign: fits the capacity to one part in `parts` more points.
  void FitCapacity(std::size_t parts);

  // Process points in the order of their places: each is mostly near the one before it, and finds
  // what that touched in the cache.
  std::uint32_t PlaceOf(std::uint32_t id) const {
    std::uint32_t node = leaf_of_[id];
    while (node >= built_nodes_) node = nodes_[node].parent;
    return node;
  }

 private:
  static constexpr int kLeafCapacity = 12;
  static constexpr std::size_t kBuiltLeaf = 8;  // points of a leaf at most, when built
  static constexpr std::size_t kRebuild = 4;
  static constexpr std::uint32_t kNone = 0xffffffffu;
  // Exceeds the rounding error of a distance in R^d, d up to thousands: no point at the border of a
  // ball is missed.
  static constexpr double kRounding = 1 + 1e-12;

  struct Node {
    double radius = 0;    // of the ball that holds its points
    double outreach = 0;  // max over its points of distance + influence
    std::uint32_t parent = kNone;
    std::uint32_t children = kNone;  // the first of two, side by side; kNone: a leaf
    std::uint32_t first = 0;         // leaf: its slots begin here
    std::uint32_t count = 0;         // leaf: points held
  };

  const double* Point(std::uint32_t id) const {
    return coordinates_->data() + static_cast<std::size_t>(id) * static_cast<std::size_t>(d_);
  }
  const double* Centre(std::uint32_t n) const {
    return centres_.data() + static_cast<std::size_t>(n) * static_cast<std::size_t>(d_);
  }
  double* Centre(std::uint32_t n) {
    return centres_.data() + static_cast<std::size_t>(n) * static_cast<std::size_t>(d_);
  }

  std::uint32_t NewNodes(int count);
  // The places of a node's descendants.
  struct Place {
    std::uint32_t node, slot;
  };
  // How points are halved and halved again.
  struct Halves {
    std::uint32_t leaves = 1;
    std::uint32_t* middle = nullptr;  // of a leaf: null
    std::unique_ptr<Halves> first, second;
  };
  std::unique_ptr<Halves> Halve(std::uint32_t* begin, std::uint32_t* end, Halving halving) const;
  std::uint32_t* Middle(std::uint32_t* begin, std::uint32_t* end, Halving halving) const;
  void Build(std::uint32_t node, Place place, std::uint32_t* begin, std::uint32_t* end,
             const Halves& halves);
  void Gather(std::uint32_t n, const double* q, double radius,
              std::vector<std::uint32_t>* ids) const;
  void MakeLeaf(std::uint32_t node, std::uint32_t first_slot, const std::uint32_t* begin,
                const std::uint32_t* end);
  void Mean(const std::uint32_t* begin, const std::uint32_t* end, double* mean) const;
  void Measure(std::uint32_t node, const std::uint32_t* begin, const std::uint32_t* end);
  void MeasureOutreach(std::uint32_t leaf);
  double OutreachOfChildren(std::uint32_t node) const;
  void Split(std::uint32_t node);
  void Rebuild(Halving halving);

  template <typename Visit>
  void Influencing(std::uint32_t n, double d2, const double* q, Visit& visit) const {
    const Node& node = nodes_[n];
    const double outreach = kRounding * node.outreach;
    if (d2 >= outreach * outreach) return;
    if (node.children == kNone) {
      double distance2[kLeafCapacity];
      MeasureLeaf(node, q, distance2);
      for (std::uint32_t i = 0; i < node.count; ++i) {
        const std::uint32_t id = slots_[node.first + i];
        if (distance2[i] < influence_[id] * influence_[id]) visit(id);
      }
      return;
    }
    const auto [a, b] = Children(node, q);
    Influencing(a.id, a.d2, q, visit);
    Influencing(b.id, b.d2, q, visit);
  }

  // All distances are compared squared. d2: from q to the node's centre.
  template <typename Radius, typename Visit>
  void Near(std::uint32_t n, double d2, const double* q, Radius& radius, Visit& visit) const {
    const Node& node = nodes_[n];
    const double far = kRounding * (radius() + node.radius);
    if (d2 > far * far) return;
    if (node.children == kNone) return NearInLeaf(node, q, radius, visit, [](auto, auto) {});
    const auto [first, second] = NearerFirst(node, q);
    Near(first.id, first.d2, q, radius, visit);
    Near(second.id, second.d2, q, radius, visit);
  }

  bool AnyWithin(std::uint32_t n, double d2, const double* q, double radius) const {
    const Node& node = nodes_[n];
    const double far = kRounding * (radius + node.radius);
    if (d2 > far * far) return false;
    if (node.children == kNone) {
      double distance2[kLeafCapacity];
      MeasureLeaf(node, q, distance2);
      return std::any_of(distance2, distance2 + node.count,
                         [&](double away2) { return away2 <= radius * radius; });
    }
    const auto [first, second] = NearerFirst(node, q);
    return AnyWithin(first.id, first.d2, q, radius) || AnyWithin(second.id, second.d2, q, radius);
  }

  template <typename Radius, typename NearVisit, typename InfluencingVisit>
  void Around(std::uint32_t n, double d2, const double* q, Radius& radius, NearVisit& near,
              InfluencingVisit& influencing) const {
    const Node& node = nodes_[n];
    const double far = kRounding * (radius() + node.radius);
    const double outreach = kRounding * node.outreach;
    if (d2 >= outreach * outreach && d2 > far * far) return;
    if (node.children == kNone) {
      NearInLeaf(node, q, radius, near, [&](std::uint32_t id, double distance2) {
        if (distance2 < influence_[id] * influence_[id]) influencing(id);
      });
      return;
    }
    const auto [first, second] = NearerFirst(node, q);
    Around(first.id, first.d2, q, radius, near, influencing);
    Around(second.id, second.d2, q, radius, near, influencing);
  }

  struct Child {
    std::uint32_t id;
    double d2;  // from q to its centre
  };
  std::pair<Child, Child> Children(const Node& node, const double* q) const;
  std::pair<Child, Child> NearerFirst(const Node& node, const double* q) const {
    const auto [a, b] = Children(node, q);
    return a.d2 <= b.d2 ? std::pair{a, b} : std::pair{b, a};
  }
  // The squared distances of a leaf's points.
  void MeasureLeaf(const Node& leaf, const double* q, double* distance2) const;

  // Nearest first: what is visited early may shrink the radius most. `each` sees every point.
  template <typename Radius, typename Visit, typename Each>
  void NearInLeaf(const Node& node, const double* q, Radius& radius, Visit& visit,
                  const Each& each) const {
    std::pair<double, std::uint32_t> near[kLeafCapacity];
    std::uint32_t count = 0;
    const double reach = radius();
    double distance2[kLeafCapacity];
    MeasureLeaf(node, q, distance2);
    for (std::uint32_t i = 0; i < node.count; ++i) {
      const std::uint32_t id = slots_[node.first + i];
      const double d2 = distance2[i];
      each(id, d2);
      if (!(d2 <= reach * reach)) continue;
      std::uint32_t at = count++;
      for (; at > 0 && near[at - 1].first > d2; --at) near[at] = near[at - 1];
      near[at] = {d2, id};
    }
    for (std::uint32_t i = 0; i < count; ++i) {
      const double r = radius();
      if (near[i].first > r * r) break;
      visit(near[i].second, near[i].first);
    }
  }

  int d_;
  const std::vector<double>* coordinates_;
  std::vector<Node> nodes_;
  std::vector<double> centres_;         // d each
  std::vector<std::uint32_t> slots_;    // leaves, kLeafCapacity each
  std::vector<double> influence_;       // by id
  std::vector<std::uint32_t> leaf_of_;  // by id
  std::vector<std::uint32_t> stale_;    // leaves whose outreach may have shrunk
  std::size_t built_ = 0;               // size at the last rebuild
  std::size_t built_nodes_ = 0;         // nodes then, numbered along the tree
};

// Writes the `count` points nearest to q as (squared distance, id), nearest first and ties by id,
// and returns how many there are: fewer only if the tree has fewer.
//
//   std::pair<double, std::uint32_t> nearest[2];
//   const int found = FindNearest(tree, q, 2, nearest);
inline int FindNearest(const BallTree& tree, const double* q, int count,
                       std::pair<double, std::uint32_t>* nearest) {
  int found = 0;
  tree.VisitNear(
      q, [&] { return found < count ? INFINITY : std::sqrt(nearest[count - 1].first); },
      [&](std::uint32_t id, double distance2) {
        const std::pair<double, std::uint32_t> candidate{distance2, id};
        if (found == count && !(candidate < nearest[count - 1])) return;
        int at = found < count ? found++ : count - 1;
        for (; at > 0 && candidate < nearest[at - 1]; --at) nearest[at] = nearest[at - 1];
        nearest[at] = candidate;
      });
  return found;
}

// Returns the squared distance from q to the nearest point; infinity if there is none.
inline double NearestSquaredDistance(const BallTree& tree, const double* q) {
  double best = INFINITY;
  tree.VisitNear(
      q, [&] { return std::sqrt(best); },
      [&](std::uint32_t, double d2) {
        if (d2 < best) best = d2;
      });
  return best;
}

}  // namespace stellate::core
