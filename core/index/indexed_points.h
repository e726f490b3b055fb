#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/capacity.h"
#include "core/index/ball_tree.h"

namespace stellate::core {

// Points of R^d and the ball tree that searches them. A value: a copy searches its own points.
//
//   IndexedPoints points(3);
//   points.Add(x);                                   // the tree finds it from now on
//   points.AddUnindexed(y);                          // the tree does not, until Index()
//   points.tree().VisitNear(q, radius, visit);
class IndexedPoints {
 public:
  explicit IndexedPoints(int d) : stride_(static_cast<std::size_t>(d)), tree_(d, &coordinates_) {}
  IndexedPoints(const IndexedPoints& other)
      : stride_(other.stride_),
        coordinates_(other.coordinates_),
        tree_(other.tree_, &coordinates_) {}
  IndexedPoints& operator=(const IndexedPoints&) = delete;

  // Adds the point with the next id, without influence.
  void Add(const double* point) {
    ReserveMore(stride_, &coordinates_);
    AddUnindexed(point);
    tree_.Insert(0);
  }
  // REQUIRES: Index() before the next Add().
  void AddUnindexed(const double* point) {
    coordinates_.insert(coordinates_.end(), point, point + stride_);
  }
  // Builds the tree of all points, none with an influence.
  void Index(BallTree::Halving halving = BallTree::Halving::kNumber) {
    tree_.Assign(std::vector<double>(size(), 0.0), halving);
  }
  bool is_indexed() const { return tree_.size() == size(); }
  // Sets the capacity to one part in `parts` more points, and little more. REQUIRES: is_indexed().
  void FitCapacity(std::size_t parts) {
    core::FitCapacity(parts, &coordinates_);
    tree_.FitCapacity(parts);
  }

  std::size_t size() const { return coordinates_.size() / stride_; }
  const double* Point(std::size_t id) const { return coordinates_.data() + id * stride_; }
  const std::vector<double>& coordinates() const { return coordinates_; }  // d each
  const BallTree& tree() const { return tree_; }
  BallTree& tree() { return tree_; }

 private:
  std::size_t stride_;
  std::vector<double> coordinates_;
  BallTree tree_;
};

}  // namespace stellate::core
