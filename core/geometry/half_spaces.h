#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace stellate::core {

// Where the facets of a cell meet.

// Solves the K x K system rows . x = rhs by elimination with partial pivoting. False if singular.
template <int K>
inline bool SolveSquare(double (&m)[K][K + 1], double* x) {
  for (int c = 0; c < K; ++c) {
    int pivot = c;
    for (int r = c + 1; r < K; ++r)
      if (std::abs(m[r][c]) > std::abs(m[pivot][c])) pivot = r;
    if (m[pivot][c] == 0) return false;
    if (pivot != c) std::swap(m[pivot], m[c]);
    const double inverse = 1.0 / m[c][c];
    for (int r = c + 1; r < K; ++r) {
      const double factor = m[r][c] * inverse;
      for (int j = c + 1; j <= K; ++j) m[r][j] -= factor * m[c][j];
    }
  }
  for (int r = K - 1; r >= 0; --r) {
    double s = m[r][K];
    for (int j = r + 1; j < K; ++j) s -= m[r][j] * x[j];
    x[r] = s / m[r][r];
  }
  return true;
}

template <>
inline bool SolveSquare<2>(double (&m)[2][3], double* x) {
  const double det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
  if (det == 0) return false;
  const double inverse = 1.0 / det;
  x[0] = (m[0][2] * m[1][1] - m[0][1] * m[1][2]) * inverse;
  x[1] = (m[0][0] * m[1][2] - m[0][2] * m[1][0]) * inverse;
  return true;
}

// A point of an edge is no farther from p than the edge's farther end: this share is far above
// rounding in a well-conditioned solve and far below any distance that matters.
inline constexpr double kSlack = 1e-9;
// A judged cell is no convex polytope, and its edges' ends are only about where the facets meet.
inline constexpr double kJudgedSlack = 3;

// { x : normal . x <= offset }, borrowed.
template <int K>
struct HalfSpaceRef {
  std::uint32_t id;
  const double* normal;
  double offset;
};

// An end of an edge that a cut crosses.
struct EdgeEnd {
  const double* x;
  double norm2;
  double excess;  // over the cut: positive where it is removed
};

// The vertex where K half-spaces' borders meet: writes x, returns its squared norm.
//
// The coordinates come from the facets alone, in the order of their ids, so that they do not
// depend on the order of the cuts. Where the facets are too nearly parallel for that, the point is
// interpolated on the edge that the cut crosses. `slack`: how much farther from p than the edge's
// farther end the point may lie.
template <int K>
double Meet(HalfSpaceRef<K> (&planes)[K], const EdgeEnd& kept, const EdgeEnd& removed, double slack,
            double* x) {
  for (int i = 1; i < K; ++i)
    for (int j = i; j > 0 && planes[j].id < planes[j - 1].id; --j)
      std::swap(planes[j], planes[j - 1]);
  double m[K][K + 1];
  for (int r = 0; r < K; ++r) {
    for (int a = 0; a < K; ++a) m[r][a] = planes[r].normal[a];
    m[r][K] = planes[r].offset;
  }
  const bool solved = SolveSquare<K>(m, x);
  double norm2 = 0;
  for (int a = 0; a < K; ++a) norm2 += x[a] * x[a];
  if (solved && norm2 <= std::max(kept.norm2, removed.norm2) * (1 + slack)) return norm2;
  const double u = removed.excess > kept.excess ? -kept.excess / (removed.excess - kept.excess) : 0;
  norm2 = 0;
  for (int a = 0; a < K; ++a) {
    x[a] = kept.x[a] + u * (removed.x[a] - kept.x[a]);
    norm2 += x[a] * x[a];
  }
  return norm2;
}

}  // namespace stellate::core
