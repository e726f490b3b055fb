#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "stellate/catalogue.h"
#include "tests/support/run_mesher.h"

namespace stellate::testing {

// How well a mesh follows its manifold, measured against the catalogue's own knowledge of it and
// none of the mesher's.
struct Approximation {
  // Hausdorff distance, length. Taken from the mesh to M, at each simplex's barycentre and at
  // those of its faces. Of a mesh that the closest-point map carries onto M, as a certified one's
  // does, the distance from M to the mesh is no larger.
  double hausdorff = 0;
  double max_angle = 0;   // of a simplex to the tangent spaces of its vertices, radians
  double mean_angle = 0;  // over simplices, of the largest at a vertex
};

// Largest angle between the span of `edges` (d x j) and that of `tangent` (d x k, orthonormal).
inline double AngleBetween(const Eigen::MatrixXd& edges, const Eigen::MatrixXd& tangent) {
  const Eigen::MatrixXd span = Eigen::HouseholderQR<Eigen::MatrixXd>(edges).householderQ() *
                               Eigen::MatrixXd::Identity(edges.rows(), edges.cols());
  const Eigen::MatrixXd residual = span - tangent * (tangent.transpose() * span);
  return std::asin(std::min(1.0, residual.jacobiSvd().singularValues()[0]));
}

inline Approximation MeasureApproximation(Manifold& manifold, const FinishedRun& run) {
  const Eigen::Index d = manifold.ambient_dimension(), k = manifold.dimension();
  const Eigen::Index corners = k + 1;
  const Eigen::Index simplices = static_cast<Eigen::Index>(run.simplices.size()) / corners;
  const Eigen::MatrixXd tangents = manifold.TangentBasis(run.points);

  Approximation result;
  Eigen::MatrixXd vertices(d, corners);
  for (Eigen::Index s = 0; s < simplices; ++s) {
    const std::uint32_t* ids = run.simplices.data() + s * corners;
    for (Eigen::Index i = 0; i < corners; ++i) vertices.col(i) = run.points.col(ids[i]);

    // Every face of dimension 1 to k, as a set of corners.
    const unsigned faces = 1u << corners;
    Eigen::MatrixXd barycentres = Eigen::MatrixXd::Zero(d, faces);
    Eigen::Index count = 0;
    for (unsigned face = 1; face < faces; ++face) {
      if ((face & (face - 1)) == 0) continue;
      int size = 0;
      for (Eigen::Index i = 0; i < corners; ++i) {
        if ((face >> i & 1u) == 0) continue;
        barycentres.col(count) += vertices.col(i);
        ++size;
      }
      barycentres.col(count++) /= size;
    }
    result.hausdorff =
        std::max(result.hausdorff, manifold.Distance(barycentres.leftCols(count)).maxCoeff());

    const Eigen::MatrixXd edges = vertices.rightCols(k).colwise() - vertices.col(0);
    double largest = 0;
    for (Eigen::Index i = 0; i < corners; ++i) {
      Eigen::MatrixXd tangent(d, k);
      for (Eigen::Index row = 0; row < d; ++row) {
        for (Eigen::Index a = 0; a < k; ++a) tangent(row, a) = tangents(row * k + a, ids[i]);
      }
      largest = std::max(largest, AngleBetween(edges, tangent));
    }
    result.max_angle = std::max(result.max_angle, largest);
    result.mean_angle += largest / static_cast<double>(simplices);
  }
  return result;
}

// The exponent b of the power law y = a x^b, by least squares on logarithms.
inline double FitExponent(const std::vector<double>& x, const std::vector<double>& y) {
  const double n = static_cast<double>(x.size());
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double u = std::log(x[i]), v = std::log(y[i]);
    sx += u;
    sy += v;
    sxx += u * u;
    sxy += u * v;
  }
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

}  // namespace stellate::testing
