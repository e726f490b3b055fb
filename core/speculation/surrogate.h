#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/complex/stars.h"
#include "core/refinement/candidate_set.h"

namespace stellate::core {

// Estimates M between the sample points, without queries: at each point p by a graph over its
// tangent space,
//
//   y(u) = p + T_p u + N_p(u),   u in R^K,   N_p a polynomial of degrees 2 and 3,
//
// fitted to the positions and the tangent spaces of p's neighbours in the star. The graphs of the
// nearest points are blended by weights that vanish before a graph drops out, so the estimate has
// no seams: its error is smooth, and points well spaced on it are well spaced on M. Use it to plan
// queries; never mesh its points.
template <int K>
class Surrogate {
 public:
  // stars    borrowed, must not change
  // step     the distance from a point without neighbours up to which its tangent plane is used,
  //          length
  // epsilon  the final spacing of the points, length: a point for that spacing is not predicted
  //          from a sample too coarse to be exact. 0: it is predicted wherever that is certain
  //          enough for the requested spacing
  // sizes    of the sample points, borrowed, or nullptr. Between sample points they are blended
  //          like the graphs, which is right to second order; the least of a few would be far too
  //          small
  Surrogate(const Stars<K>& stars, double step, double epsilon, const double* sizes = nullptr);

  // Predicts the answer for each of `points`, d x n: its closest point on M or, if `flats` has a
  // tangent basis T (K rows of d) instead of nullptr, the intersection of M with x + T^perp. The
  // answer is found, with tangents and sizes if there are any, unless M is not known well enough
  // for `spacing`, a length for each. In parallel; the result does not depend on earlier calls.
  AnsweredPoints Answer(const Eigen::MatrixXd& points, const std::vector<const double*>& flats,
                        const Eigen::VectorXd& spacing);

 private:
  static constexpr int kQuadratic = K * (K + 1) / 2;
  static constexpr int kTerms = kQuadratic + K * (K + 1) * (K + 2) / 6;
  static constexpr int kBlended = 3 * K;
  static constexpr std::uint32_t kNone = 0xffffffffu;

  struct Graph {
    double scale = 0;  // the neighbours' mean distance: u is divided by it; 0: no neighbours
    double error = 0;  // by which it misses its neighbours, length
  };
  // The nearest points, and the distance of the next one: weights vanish there.
  struct Near {
    std::array<std::pair<double, std::uint32_t>, kBlended + 1> points;
    int count = 0;
    double radius2 = 0;
    void Add(const std::pair<double, std::uint32_t>& candidate);
    void Close();
  };
  struct Guess {
    double uncertainty = 0;  // length
    double spacing = 0;      // of the sample here, length
    double size = 0;
  };

  static void Terms(const double* v, double* terms);
  static void Slopes(const double* v, double (*slopes)[kTerms]);
  std::vector<Near> FindNear(const Eigen::MatrixXd& points) const;
  void Prepare(const std::vector<Near>& near);
  void Fit(std::uint32_t p, std::uint32_t slot);
  double Doubt(const Graph& graph, double length) const;
  bool Blend(const Near& near, const double* x, double* point, double* tangent, Guess* guess) const;
  bool Predict(const Near& near, const double* x, const double* flat, double spacing, double* point,
               double* tangent, double* size) const;

  const Stars<K>& stars_;
  const double* sizes_;
  double step_, epsilon_;
  std::size_t form_size_;
  std::vector<std::uint32_t> slot_;  // by point; kNone: not fitted yet
  std::vector<Graph> graphs_;        // by slot
  std::vector<double> forms_;        // by slot: kTerms coefficients, d each
};

STELLATE_DECLARE_CLASS(Surrogate)

}  // namespace stellate::core
