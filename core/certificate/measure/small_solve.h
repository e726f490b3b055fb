#pragma once

#include <array>
#include <cmath>
#include <utility>

#include "core/specification.h"

namespace stellate::core {

// The determinant of a matrix with these column lengths, squared and multiplied, is not within
// rounding of zero.
inline bool IsTellingDeterminant(double determinant, double lengths2) {
  return determinant * determinant > 1e-24 * lengths2;
}

// A linear system of at most kMaxDimension unknowns, solved in place by elimination with row
// pivoting: the inner loop of tests that decide on which side of a simplex, or inside which, a
// point is.
struct SmallSystem {
  std::array<std::array<double, kMaxDimension>, kMaxDimension> a;  // a[row][column]
  std::array<double, kMaxDimension> b;                             // right side, then solution

  // Returns the determinant's sign, with the solution in b; 0, with b undefined, if the determinant
  // is within rounding of zero: below 1e-12 of the product of the column lengths. `n`: the number
  // of unknowns, an int or, if the compiler knows it, a std::integral_constant.
  template <typename Number>
  int Solve(Number n) {
    double lengths2 = 1;
    for (int c = 0; c < n; ++c) {
      double squared = 0;
      for (int r = 0; r < n; ++r) squared += a[r][c] * a[r][c];
      lengths2 *= squared;
    }
    double determinant = 1;
    for (int c = 0; c < n; ++c) {
      int pivot = c;
      for (int r = c + 1; r < n; ++r) {
        if (std::abs(a[r][c]) > std::abs(a[pivot][c])) pivot = r;
      }
      if (a[pivot][c] == 0) return 0;
      if (pivot != c) {
        std::swap(a[pivot], a[c]);
        std::swap(b[pivot], b[c]);
        determinant = -determinant;
      }
      determinant *= a[c][c];
      for (int r = c + 1; r < n; ++r) {
        const double factor = a[r][c] / a[c][c];
        for (int j = c + 1; j < n; ++j) a[r][j] -= factor * a[c][j];
        b[r] -= factor * b[c];
      }
    }
    if (!IsTellingDeterminant(determinant, lengths2)) return 0;
    for (int r = n - 1; r >= 0; --r) {
      for (int j = r + 1; j < n; ++j) b[r] -= a[r][j] * b[j];
      b[r] /= a[r][r];
    }
    return determinant > 0 ? 1 : -1;
  }
};

}  // namespace stellate::core
