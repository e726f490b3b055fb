#pragma once

namespace stellate::core {

// A tangent basis is k vectors of R^d, in one of two layouts:
//
//   by vector      entry a*d + i is coordinate i of vector a: the mesher's own, in which each
//                  vector is an array for inner loops;
//   by coordinate  entry i*k + a is the same number: the wire's, a matrix d x k in C order.
//
// Both functions copy; the arrays hold d*k numbers each and must not overlap.

inline void ToByCoordinate(const double* by_vector, int d, int k, double* by_coordinate) {
  for (int i = 0; i < d; ++i)
    for (int a = 0; a < k; ++a) by_coordinate[i * k + a] = by_vector[a * d + i];
}

inline void ToByVector(const double* by_coordinate, int d, int k, double* by_vector) {
  for (int i = 0; i < d; ++i)
    for (int a = 0; a < k; ++a) by_vector[a * d + i] = by_coordinate[i * k + a];
}

}  // namespace stellate::core
