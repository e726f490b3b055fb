#pragma once

#include <cmath>

namespace stellate::core {

// Inner loops over ambient coordinates. Four running sums: the compiler vectorises them, and the
// order of additions depends on d alone, so that results do not depend on where an array lies.
// R^3, where most people live, is spelled out so that the calls vanish.
inline double LongDot(const double* a, const double* b, int d) {
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

[[gnu::always_inline]] inline double Dot(const double* a, const double* b, int d) {
  if (d == 3) return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  return LongDot(a, b, d);
}

inline double LongSquaredDistance(const double* a, const double* b, int d) {
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

[[gnu::always_inline]] inline double SquaredDistance(const double* a, const double* b, int d) {
  if (d == 3) {
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
  }
  return LongSquaredDistance(a, b, d);
}

inline double Distance(const double* a, const double* b, int d) {
  return std::sqrt(SquaredDistance(a, b, d));
}

}  // namespace stellate::core
