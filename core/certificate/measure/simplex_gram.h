#pragma once

#include <array>

namespace stellate::core {

// The Gram matrix of a K-simplex's edges from one of its vertices, factored as L D L^t. It gives
// the size, the fatness and the tilt of the simplex in a few operations. A thin simplex loses half
// of the digits; TakeFrame keeps them.
//
//   SimplexGram<2> gram;
//   gram.dots = ...;  // lower triangle
//   if (gram.Factor()) use gram.SquaredCircumradius();
template <int K>
struct SimplexGram {
  using Row = std::array<double, K>;

  std::array<Row, K> dots;  // lower triangle: set by the caller
  std::array<Row, K> lower;
  Row inverse;             // of the pivots
  double determinant = 0;  // the squared volume times K!^2

  // Returns false if the simplex is so thin that the other results would have little meaning; else
  // their relative error is 1e-10.
  [[gnu::always_inline]] bool Factor() {
    constexpr double kTelling = 1e-4;
    double product = 1, least = 1;
    determinant = 1;
    for (int i = 0; i < K; ++i) {
      Row scaled;  // of `lower` by the pivots
      double pivot = dots[i][i];
      product *= pivot;
      for (int j = 0; j < i; ++j) {
        scaled[j] = dots[i][j];
        for (int a = 0; a < j; ++a) scaled[j] -= scaled[a] * lower[j][a];
        lower[i][j] = scaled[j] * inverse[j];
        pivot -= scaled[j] * lower[i][j];
      }
      inverse[i] = 1 / pivot;
      determinant *= pivot;
      least = pivot < least ? pivot : least;
    }
    return least > 0 && determinant > kTelling * product;
  }

  // Returns x^t G^-1 x. REQUIRES: Factor() was true.
  [[gnu::always_inline]] double InverseForm(const Row& x) const {
    Row y;
    double sum = 0;
    for (int i = 0; i < K; ++i) {
      y[i] = x[i];
      for (int j = 0; j < i; ++j) y[i] -= lower[i][j] * y[j];
      sum += y[i] * y[i] * inverse[i];
    }
    return sum;
  }

  // Returns the squared circumradius. REQUIRES: as above.
  [[gnu::always_inline]] double SquaredCircumradius() const {
    Row half;
    for (int i = 0; i < K; ++i) half[i] = dots[i][i] / 2;
    return InverseForm(half);
  }
};

}  // namespace stellate::core
