#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace stellate::testing {

// Points of a manifold that is known, and what is known of it.
struct Sample {
  int k = 0, d = 0;
  double volume = 0, reach = 0;
  std::int64_t euler = 0;
  std::vector<int> betti;  // mod 2, 0 to k
  bool orientable = true;
  int components = 1;
  Eigen::MatrixXd points;    // d x n
  Eigen::MatrixXd tangents;  // (d k) x n, entry i k + a is coordinate i of vector a

  // (volume / n)^(1/k)
  double Spacing() const;
};

// How a sample is drawn.
struct SampleRequest {
  // circle, knot (k = 1); s2, torus, t2, klein, shells, half (k = 2); s3, so3, t3 (k = 3).
  // shells: two spheres `gap` spacings apart; half: a torus where x >= 0.
  std::string manifold;
  std::uint32_t points = 1000;  // about as many for an even sample
  bool even = false;            // as a Poisson disk sample; else independent and uniform
  double noise = 0;             // standard deviation of each coordinate, in spacings
  std::uint64_t seed = 1;
  double gap = 1;       // of shells, in spacings
  double hole = 0;      // radius of a ball about the first point that is left empty, in spacings
  double outliers = 0;  // share of the points that is replaced by uniform ones of the bounding box
};

Sample Draw(const SampleRequest& request);

// A kind of sample, as a table names it.
struct NamedRequest {
  std::string name;
  SampleRequest request;
};

// What is asked to come out right: circles and knots, surfaces and 3-manifolds, even and uniform,
// with a noise of up to 0.4 spacings, and up to 0.2 at k = 3.
std::vector<NamedRequest> GoodSamples();

}  // namespace stellate::testing
