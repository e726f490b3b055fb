#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/instantiate.h"
#include "core/complex/star_builder.h"
#include "core/peers.h"

namespace stellate::core {

// Points of the sample, copied side by side in memory to be read many times.
struct GatheredPoints {
  std::size_t count = 0;
  std::vector<std::uint32_t> ids;  // the first `count` are in use
  std::vector<double> points;      // likewise, d each
};

// Builds the stars of all points of a sample together: one search serves a whole bunch of points.
// StarBuilder has a table of the ways to build a star.
//
//   Blocks<RestrictedVoronoiCell<2>> stars;
//   stars.resize(sample.size());
//   BulkStarBuilder<2>(builder).Build(&stars, influence.data());
//
// A star depends only on the points within its reach. A part of a sample, together with all points
// that far around it, therefore has the stars of the whole, bit for bit, if its points keep their
// order and their names (Sample::NameLast).
template <int K>
class BulkStarBuilder {
 public:
  using Cell = RestrictedVoronoiCell<K>;

  // peers: the parts that build them together, each all of them; all is borrowed
  explicit BulkStarBuilder(const StarBuilder<K>& builder, const Peers& peers = NoPeers())
      : builder_(builder), sample_(builder.sample()), peers_(peers) {}

  // Writes the star of each point, by id, and its influence (StarBuilder::Influence). In parallel;
  // the same for any number of threads. REQUIRES: `stars` has as many places as the sample points.
  void Build(Blocks<Cell>* stars, double* influence) const;

 private:
  void BuildPolygons(Blocks<Cell>* stars, double* influence) const;
  void BuildPolygonsOf(std::span<const BallTree::Bunch> bunches, Blocks<Cell>* stars,
                       double* influence) const;
  double BuildPolygon(const Site& p, const GatheredPoints& gathered,
                      const std::vector<std::uint32_t>& around, Cell* star) const;
  double BuildOnWalls(const Site& p, const std::vector<std::uint32_t>& ids, Cell* star) const;

  const StarBuilder<K>& builder_;
  const Sample<K>& sample_;
  const Peers& peers_;
};

STELLATE_DECLARE_CLASS(BulkStarBuilder)

}  // namespace stellate::core
