#pragma once

#include <cmath>
#include <cstddef>
#include <type_traits>

namespace stellate::core {

// Inner loops over ambient coordinates, of vectors of d numbers each.
//
//   Dot(a, b, d);              // a . b
//   SquaredDistance(a, b, d);  // |a - b|^2
//   Distance(a, b, d);         // |a - b|
//
// Four running sums: the compiler vectorises them, and the
// order of additions depends only on d, so that results do not depend on an array's alignment. R^3,
// the most frequent case, and R^4 are written out so that the calls are inlined, as they are if the
// compiler knows d.
//
// The Unrolled and Long forms are steps of these; call Dot and SquaredDistance.
[[gnu::always_inline]] inline double UnrolledDot(const double* a, const double* b, int d) {
  double s0 = 0, s1 = 0, s2 = 0, s3 = 0;
  int i = 0;
  for (; i + 4 <= d; i += 4) {
    s0 += a[i] * b[i];
    s1 += a[i + 1] * b[i + 1];
    s2 += a[i + 2] * b[i + 2];
    s3 += a[i + 3] * b[i + 3];
  }
  for (; i < d; ++i) s0 += a[i] * b[i];
  return (s0 + s1) + (s2 + s3);
}

inline double LongDot(const double* a, const double* b, int d) { return UnrolledDot(a, b, d); }

// Returns a . b.
[[gnu::always_inline]] inline double Dot(const double* a, const double* b, int d) {
  if (d == 3) return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  if (d == 4) return (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]);
  return __builtin_constant_p(d) ? UnrolledDot(a, b, d) : LongDot(a, b, d);
}

// Returns call(std::integral_constant<int, D>()), D = d if d is small, else 0: loops over
// coordinates unroll if D is known at compile time. `call` has to return the same type for all D.
//
//   WithDimension(d, [&](auto known) { return Dot(a, b, known() > 0 ? known() : d); });
template <typename Call>
inline auto WithDimension(int d, const Call& call) {
  switch (d) {
#define STELLATE_CASE(D) \
  case D:                \
    return call(std::integral_constant<int, D>());
    STELLATE_CASE(3)
    STELLATE_CASE(4)
    STELLATE_CASE(5)
    STELLATE_CASE(6)
    STELLATE_CASE(7)
    STELLATE_CASE(8)
    STELLATE_CASE(9)
    STELLATE_CASE(10)
#undef STELLATE_CASE
    default:
      return call(std::integral_constant<int, 0>());
  }
}

// Writes dots[i] = row i . v, for `count` rows of d numbers each: the tangent coordinates of v,
// where the rows are a tangent basis.
inline void DotRows(const double* rows, std::size_t count, const double* v, int any_d,
                    double* dots) {
  WithDimension(any_d, [&](auto known) {
    const int d = known() > 0 ? known() : any_d;
    const double* row = rows;
    for (std::size_t i = 0; i < count; ++i, row += d) dots[i] = Dot(row, v, d);
  });
}

[[gnu::always_inline]] inline double UnrolledSquaredDistance(const double* a, const double* b,
                                                             int d) {
  double s0 = 0, s1 = 0, s2 = 0, s3 = 0;
  int i = 0;
  for (; i + 4 <= d; i += 4) {
    const double e0 = a[i] - b[i], e1 = a[i + 1] - b[i + 1];
    const double e2 = a[i + 2] - b[i + 2], e3 = a[i + 3] - b[i + 3];
    s0 += e0 * e0;
    s1 += e1 * e1;
    s2 += e2 * e2;
    s3 += e3 * e3;
  }
  for (; i < d; ++i) s0 += (a[i] - b[i]) * (a[i] - b[i]);
  return (s0 + s1) + (s2 + s3);
}

inline double LongSquaredDistance(const double* a, const double* b, int d) {
  return UnrolledSquaredDistance(a, b, d);
}

// Returns |a - b|^2.
[[gnu::always_inline]] inline double SquaredDistance(const double* a, const double* b, int d) {
  if (d == 3) {
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
  }
  if (d == 4) {
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2], w = a[3] - b[3];
    return (x * x + y * y) + (z * z + w * w);
  }
  return __builtin_constant_p(d) ? UnrolledSquaredDistance(a, b, d) : LongSquaredDistance(a, b, d);
}

// Returns |a - b|.
inline double Distance(const double* a, const double* b, int d) {
  return std::sqrt(SquaredDistance(a, b, d));
}

}  // namespace stellate::core
