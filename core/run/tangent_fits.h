#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/index/indexed_points.h"

namespace stellate::core {

// Estimates tangent spaces of M from its points near by. Over a k-plane near T_yM, M is a graph
// about y,
//
//   v(u) = A u + Q(u, u) + C(u, u, u),   u in R^k.
//
// The positions of points near y, and the slopes where tangent spaces are known, are linear in A, Q
// and C: least squares find them, and A gives T_yM. Where points are on one side of y alone C is
// left out: the error is O(h^2), h the distance of the points, and errors of known tangent spaces
// come back halved, so that a lattice can grow by its own estimates, ring after ring. Where they
// are all around it is O(h^4), and a third of them.
//
//   TangentFits fits(k, d);
//   fits.Know(points, tangents, normals, known);
//   fits.Look(answers);                      // points with unknown tangent spaces, all of a round
//   fit = fits.At(i, guess);                 // of the i-th of them
//   fits.Refine(points, most, &tangents);    // estimates, by all that is known by now
//
// Estimates have no bound: they never enter a proof.
class TangentFits {
 public:
  TangentFits(int k, int d);

  enum class Knowledge : std::uint8_t { kNone, kEstimate, kExact };
  // Adds points of M, d x n, with tangent bases (K rows of d) x n, except where these are not
  // known. normals: unit normals of M there, one each, d x n; zero: none.
  void Know(const Eigen::MatrixXd& points, const Eigen::MatrixXd& tangents,
            const Eigen::MatrixXd& normals, const std::vector<Knowledge>& known);
  // Sets the points to look at, d x n: they replace those of before.
  void Look(const Eigen::MatrixXd& points);

  struct Fit {
    Eigen::MatrixXd tangents;  // d x k, orthonormal
    double misfit = 0;         // by which slopes miss the fit, root mean square: a tangent, no unit
    bool is_inside = false;    // there are points all around
  };
  // The fit at the i-th of them. guess: k rows of d, orthonormal. Nothing if too few points are
  // known about it. Pure; any thread.
  std::optional<Fit> At(Eigen::Index i, const double* guess) const;

  // Fits all estimates again, and writes the tangent bases of those at `points`, d x n, (K rows
  // of d) x n. A fit with a larger misfit changes nothing.
  void Refine(const Eigen::MatrixXd& points, double most_misfit, Eigen::MatrixXd* tangents);

 private:
  // Points near one of M, as (squared distance, id), nearest first.
  struct Neighbourhood {
    std::vector<std::pair<double, std::uint32_t>> known, others;
    double within = 0;  // no farther than this, length
  };
  Neighbourhood Around(const double* y, const IndexedPoints* looked_at) const;
  std::optional<Fit> FitAt(const double* y, const double* guess, const IndexedPoints* others) const;
  std::size_t numbers() const {
    return static_cast<std::size_t>(k_) * static_cast<std::size_t>(d_);
  }

  int k_, d_;
  IndexedPoints known_;
  std::vector<double> tangents_;  // of the known, k rows of d each
  std::vector<double> normals_;   // of the known, d each
  std::vector<std::uint8_t> is_exact_;
  std::optional<IndexedPoints> looked_at_;
};

}  // namespace stellate::core
