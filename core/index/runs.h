#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/index/ball_tree.h"

namespace stellate::core {

// Cuts points, in an order in which neighbours mostly follow each other, into runs of near points.
// Search for what is near them once a run, instead of once a point.
class Runs {
 public:
  // `points`: d each. The points of a run lie within `reach` of its first, times the first's share
  // if `shares` are given (one a point).
  Runs(std::span<const double> points, int d, double reach, std::span<const double> shares = {});

  std::size_t count() const { return radii_.size(); }
  std::size_t begin(std::size_t run) const { return begins_[run]; }
  std::size_t end(std::size_t run) const { return begins_[run + 1]; }
  // The ball around its points.
  const double* centre(std::size_t run) const { return centres_.data() + run * stride_; }
  double radius(std::size_t run) const { return radii_[run]; }
  const std::vector<double>& centres() const { return centres_; }  // d each
  const std::vector<double>& radii() const { return radii_; }

 private:
  std::size_t stride_;
  std::vector<std::size_t> begins_;
  std::vector<double> centres_;  // d each
  std::vector<double> radii_;
};

// A spatial index of such points by a ball tree of the runs, much cheaper to build than one of the
// points.
class RunTree {
 public:
  // `points` as above; borrowed.
  RunTree(std::span<const double> points, int d, double reach, std::span<const double> shares = {});
  RunTree(const RunTree&) = delete;
  RunTree& operator=(const RunTree&) = delete;

  const Runs& runs() const { return runs_; }
  // Appends the points within `radius` of q, in a fixed but arbitrary order. May append others that
  // only rounding excludes.
  void Gather(const double* q, double radius, std::vector<std::uint32_t>* ids) const;

 private:
  int d_;
  std::span<const double> points_;
  Runs runs_;
  BallTree tree_;
};

}  // namespace stellate::core
