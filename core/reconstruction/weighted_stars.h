#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/index/indexed_points.h"
#include "core/reconstruction/fitted_cloud.h"

namespace stellate::core {

// The stars of weighted points in their tangent spaces, each built when it is first asked for, and
// one star for all weights of one point together (weights.h). Ids are places in `ids`.
//
// Stars of different points may be asked for, and built, at the same time.
template <int K>
class WeightedStars {
 public:
  using Simplex = std::array<std::uint32_t, K + 1>;

  struct Star {
    bool built = false;
    std::vector<Simplex> simplices;
    std::vector<std::uint64_t> keys;
    std::vector<std::array<double, K>> corners;  // of its cell, in the tangent space
    double most2 = 0;                            // its largest circumradius, squared
  };
  // A simplex that a star has while y is between two values.
  struct Span {
    Simplex simplex;
    std::uint64_t key;
    double from, to;
  };
  // How the weight of a point is taken apart: it is `now` + 2 g y.
  struct Choice {
    std::uint32_t point;
    double lower, upper;  // of y
    double g;             // length
  };

  // `ids`: points of the cloud, ascending; `weights`: by point of the cloud, squared lengths.
  WeightedStars(const FittedCloud& cloud, const std::vector<std::uint32_t>& ids,
                const std::vector<double>& weights);

  std::uint32_t size() const { return static_cast<std::uint32_t>(ids_.size()); }
  double weight(std::uint32_t p) const { return weights_[p]; }
  // Changes no star: those that this changes have to be built again.
  void SetWeight(std::uint32_t p, double weight) { weights_[p] = weight; }
  // The largest weight that p may have.
  double MostWeight(std::uint32_t p) const;
  // (squared distance, point), nearest first.
  const std::vector<std::pair<double, std::uint32_t>>& near(std::uint32_t p) const {
    return near_[p];
  }

  const Star& StarOf(std::uint32_t p) {
    if (!stars_[p].built) Build(p);
    return stars_[p];
  }
  // Whether the star of q has the simplex of this key.
  bool Holds(std::uint32_t q, std::uint64_t key);
  void Build(std::uint32_t p);
  void BuildAll();

  // Whether a point, q aside, may be in the star of q for some weight that it may get. If not, as
  // of most that are near, BuildForAll would find nothing. REQUIRES: StarOf(q) was called since the
  // last weight changed that matters to it.
  bool MayMeet(std::uint32_t q, const Choice& choice);
  // Adds the simplices of the star of q for all weights that a point may get. Returns whether it is
  // in that star.
  bool BuildForAll(std::uint32_t q, const Choice& choice, std::vector<Span>* spans);

  // Whether the simplex tilts by more than 65 degrees against the tangent space at one of its
  // vertices.
  bool IsSliver(const Simplex& s) const;

 private:
  void MoreNear(std::uint32_t p, std::size_t count);
  bool HasAllNear(std::uint32_t p) const;
  double Influence2(double most2) const;
  double Bisector(std::uint32_t p, std::uint32_t q, double distance2, double* normal) const;
  template <typename Begin, typename Cut, typename Most2>
  void CutByNear(std::uint32_t p, const Begin& begin, const Cut& cut, const Most2& most2);

  const FittedCloud& cloud_;
  const std::vector<std::uint32_t>& ids_;
  IndexedPoints points_;
  std::vector<double> weights_;
  double most_weight_ = 0;
  std::vector<std::vector<std::pair<double, std::uint32_t>>> near_;
  std::vector<Star> stars_;
};

}  // namespace stellate::core
