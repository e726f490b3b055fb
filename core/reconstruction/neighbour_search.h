#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/index/indexed_points.h"
#include "core/reconstruction/quadric_fit.h"

namespace stellate::core {

// The nearest neighbours of points that follow each other bunch by bunch. One search serves all
// points of a bunch: it goes as far as the neighbours of the bunch before reached, and a little
// farther; a point that has not enough of them there is searched for alone. The result does not
// depend on that. Keep one for many bunches: it reuses its memory.
class BunchNeighbours {
 public:
  // `count`: of neighbours, of each point with itself. `points` is borrowed.
  BunchNeighbours(const IndexedPoints& points, int count)
      : points_(points), count_(static_cast<std::size_t>(count)), near_(count_) {}

  // Gathers what is around a bunch; then its points may be asked for.
  void Gather(const BallTree::Bunch& bunch);
  // The points nearest to p, ties by id; p itself has distance 0. Valid until the next call.
  Neighbours Of(std::uint32_t p);

 private:
  template <int D>
  void MeasureFrom(const double* point, int any_d);

  const IndexedPoints& points_;
  const std::size_t count_;
  double reach_ = 0;     // what was gathered, length
  double farthest_ = 0;  // of the bunch's neighbours, squared
  std::vector<std::uint32_t> ids_;
  std::vector<double> coordinates_;  // of ids_, all first ones first
  std::vector<double> distances2_;   // of ids_
  std::vector<std::pair<double, std::uint32_t>> near_;
};

// Neighbours of all points, which are borrowed for the time of the search.
class NeighbourSearch {
 public:
  NeighbourSearch(const std::vector<double>& points, int d);

  // Calls visit(p, neighbours, memory) for each point, in parallel; points one after the other
  // share memory = start(). The neighbours begin with p itself.
  template <typename Start, typename Visit>
  void ForEach(int count, const Start& start, const Visit& visit) const {
    const std::span<const BallTree::Bunch> bunches(bunches_);
    ParallelFor((bunches.size() + kTogether - 1) / kTogether, [&](std::size_t i) {
      BunchNeighbours near(points_, count);
      auto memory = start();
      const auto rest = bunches.subspan(i * kTogether);
      for (const BallTree::Bunch& bunch : rest.first(std::min(kTogether, rest.size()))) {
        near.Gather(bunch);
        for (const std::uint32_t p : std::span(bunch.ids, bunch.count))
          visit(p, near.Of(p), memory);
      }
    });
  }

  const std::vector<double>& points() const { return points_.coordinates(); }

 private:
  static constexpr std::size_t kTogether =
      16;  // bunches that one thread visits, one after the other

  IndexedPoints points_;
  std::vector<BallTree::Bunch> bunches_;
};

}  // namespace stellate::core
