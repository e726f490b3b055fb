#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace stellate::core {

// Computes where the facets of a cell meet.

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
// A judged cell is no convex polytope: its edges end only near the points where the facets meet.
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

// Writes the point where K half-spaces' borders meet, from them alone. Returns false if they meet
// in no point.
template <int K>
bool MeetPlanes(const HalfSpaceRef<K> (&planes)[K], double* x) {
  double m[K][K + 1];
  for (int r = 0; r < K; ++r) {
    for (int a = 0; a < K; ++a) m[r][a] = planes[r].normal[a];
    m[r][K] = planes[r].offset;
  }
  return SolveSquare<K>(m, x);
}

// The most frequent case by far: the same elimination for three planes with a normal and an offset,
// step by step, without a matrix.
template <typename Plane>
bool MeetThree(const Plane* a, const Plane* b, const Plane* c, double* x) {
  if (std::abs(b->normal[0]) > std::abs(a->normal[0])) std::swap(a, b);
  if (std::abs(c->normal[0]) > std::abs(a->normal[0])) std::swap(a, c);
  const double* const first = a->normal;
  if (first[0] == 0) return false;
  const double inverse = 1.0 / first[0];
  const double of_b = b->normal[0] * inverse, of_c = c->normal[0] * inverse;
  double b1 = b->normal[1] - of_b * first[1], c1 = c->normal[1] - of_c * first[1];
  double b2 = b->normal[2] - of_b * first[2], c2 = c->normal[2] - of_c * first[2];
  double b3 = b->offset - of_b * a->offset, c3 = c->offset - of_c * a->offset;
  if (std::abs(c1) > std::abs(b1)) {
    std::swap(b1, c1);
    std::swap(b2, c2);
    std::swap(b3, c3);
  }
  if (b1 == 0) return false;
  const double factor = c1 * (1.0 / b1);
  c2 -= factor * b2;
  c3 -= factor * b3;
  if (c2 == 0) return false;
  x[2] = c3 / c2;
  x[1] = (b3 - b2 * x[2]) / b1;
  x[0] = (a->offset - first[1] * x[1] - first[2] * x[2]) / first[0];
  return true;
}

template <>
inline bool MeetPlanes<3>(const HalfSpaceRef<3> (&planes)[3], double* x) {
  return MeetThree(&planes[0], &planes[1], &planes[2], x);
}

template <int K>
void SortById(HalfSpaceRef<K> (&planes)[K]) {
  for (int i = 1; i < K; ++i)
    for (int j = i; j > 0 && planes[j].id < planes[j - 1].id; --j)
      std::swap(planes[j], planes[j - 1]);
}

template <int K>
double SquaredNorm(const double* x) {
  double norm2 = 0;
  for (int a = 0; a < K; ++a) norm2 += x[a] * x[a];
  return norm2;
}

// Writes the point x where the edge from `kept` to `removed` crosses the cut, and returns its
// squared norm.
template <int K>
double Interpolate(const EdgeEnd& kept, const EdgeEnd& removed, double* x) {
  const double u = removed.excess > kept.excess ? -kept.excess / (removed.excess - kept.excess) : 0;
  for (int a = 0; a < K; ++a) x[a] = kept.x[a] + u * (removed.x[a] - kept.x[a]);
  return SquaredNorm<K>(x);
}

// Writes the vertex x where K half-spaces' borders meet, and returns its squared norm. The
// coordinates come from the facets alone, in the order of their ids, so that they do not depend on
// the order of the cuts. If the facets are too nearly parallel for that, the point is interpolated
// on the edge that the cut crosses. `slack`: how much farther from p than the edge's farther end
// the point may lie, as a share.
template <int K>
double Meet(HalfSpaceRef<K> (&planes)[K], const EdgeEnd& kept, const EdgeEnd& removed, double slack,
            double* x) {
  SortById<K>(planes);
  if (MeetPlanes<K>(planes, x))
    if (const double norm2 = SquaredNorm<K>(x);
        norm2 <= std::max(kept.norm2, removed.norm2) * (1 + slack))
      return norm2;
  return Interpolate<K>(kept, removed, x);
}

}  // namespace stellate::core
