#pragma once

#include <cstdint>
#include <vector>

#include "core/base/function_ref.h"
#include "core/reconstruction/fitted_cloud.h"

namespace stellate::core {

// Chooses weights of points so that the stars in tangent spaces disagree less (Chapter 3), exactly:
// for one point p, all stars around it are known for all weights of p together, since with
// y = (w(p) - w_now) / 2g, g a length,
//
//   star(q), q != p:  n_r . x        <= (|r-q|^2 + w(q) - w(r)) / 2         r != p
//                     n_p . x + g y  <= (|p-q|^2 + w(q) - w_now) / 2
//   star(p):          n_r . x - g y  <= (|r-p|^2 + w_now - w(r)) / 2
//
// are polytopes of dimension k + 1. An edge on k such facets is a k-simplex of the star, and its
// extent in y is the interval of weights for which the star has the simplex. The weight is taken
// from where the fewest simplices are in some but not all of their vertices' stars, and in the
// middle of the widest such interval.
//
//   AddWeights<3>(cloud, ids, centres, sweeps, &weights);
//
// `ids`: the points that stars are built of, ascending; `centres`: those of them that may change,
// with their neighbours. `weights`: by point of the cloud, squared lengths, changed in place; at
// most a quarter of the squared distance to the nearest point. Sweeps over the centres, one after
// the other, until all their simplices are consistent, or `sweeps` times. Returns the points that
// have another weight.
template <int K>
std::vector<std::uint32_t> AddWeights(const FittedCloud& cloud,
                                      const std::vector<std::uint32_t>& ids,
                                      const std::vector<std::uint32_t>& centres, int sweeps,
                                      std::vector<double>* weights);

struct ExudingWeights {
  std::vector<double> weights;  // by point of the cloud, squared lengths
  bool agree = false;           // whether all stars agree by them
};

// Chooses weights of all points, as AddWeights does, by which stars in tangent spaces agree. As far
// as weights can, no simplex tilts by more than 65 degrees against the tangent space at a vertex: a
// sliver counts half of a simplex about which stars disagree. For K = 3: about a millisecond a
// point. done(share) is called now and then.
template <int K>
ExudingWeights FindExudingWeights(const FittedCloud& cloud, FunctionRef<void(double)> done);

}  // namespace stellate::core
