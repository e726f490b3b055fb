#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/vector_ops.h"
#include "core/geometry/simplex.h"

namespace stellate::core {

// The inner loops of simplex.h, for callers that measure very many simplices of one kind: if j and
// d are constants they unroll, and nothing is allocated. The numbers are the same.
//
//   SimplexFrame frame;                        // once, with memory for j x d numbers
//   TakeFrame(vertices, 3, 4, frame);          // of each tetrahedron in R^4
//   if (FrameCircumradius(frame, 3) > bound) ... MeasureFramed(vertices, 3, 4, frame)

// A height below this share of the diameter is rounding error: the simplex is degenerate.
inline constexpr double kDegenerateHeight = 1e-14;

// FrameSimplex of j + 1 vertices: an orthonormal basis of their span by Gram-Schmidt, which takes
// the edge that is farthest from the span so far. Edges keep their coordinates in that basis, and
// heights are the lengths that each adds. REQUIRES: frame.directions holds j x d numbers.
[[gnu::always_inline]] inline void TakeFrame(SimplexVertices vertices, int j, int d,
                                             SimplexFrame& frame) {
  double* const e = frame.directions.data();
  double longest = 0;
  for (int a = 0; a < j; ++a) {
    for (int i = 0; i < d; ++i) e[a * d + i] = vertices[a + 1][i] - vertices[0][i];
    longest = std::max(longest, Dot(e + a * d, e + a * d, d));
    frame.heights[a] = 0;
  }
  longest = std::sqrt(longest);

  frame.rank = 0;
  for (int step = 0; step < j; ++step) {
    int farthest = step;
    double height2 = -1;
    for (int a = step; a < j; ++a) {
      const double h2 = Dot(e + a * d, e + a * d, d);
      if (h2 > height2) {
        height2 = h2;
        farthest = a;
      }
    }
    double* const u = e + step * d;
    if (farthest != step) {
      for (int i = 0; i < d; ++i) std::swap(u[i], e[farthest * d + i]);
      for (int b = 0; b < step; ++b) std::swap(frame.edges[step][b], frame.edges[farthest][b]);
    }
    for (int b = 0; b < step; ++b) {
      const double s = Dot(u, e + b * d, d);
      frame.edges[step][b] += s;
      for (int i = 0; i < d; ++i) u[i] -= s * e[b * d + i];
    }
    const double height = std::sqrt(Dot(u, u, d));
    if (!(height > kDegenerateHeight * longest)) return;
    frame.heights[step] = height;
    frame.edges[step][step] = height;
    for (int i = 0; i < d; ++i) u[i] /= height;
    for (int a = step + 1; a < j; ++a) {
      const double s = Dot(e + a * d, u, d);
      frame.edges[a][step] = s;
      for (int i = 0; i < d; ++i) e[a * d + i] -= s * u[i];
    }
    ++frame.rank;
  }
}

// Returns the circumradius, infinite for a degenerate simplex: |c|, where 2 r_i . c = |r_i|^2 for
// the edges r_i from vertex 0, whose coordinates in the frame are lower triangular.
[[gnu::always_inline]] inline double FrameCircumradius(const SimplexFrame& frame, int j) {
  if (frame.rank < j) return std::numeric_limits<double>::infinity();
  double c[kMaxSimplexDimension];
  double squared = 0;
  for (int i = 0; i < j; ++i) {
    double value = 0;
    for (int a = 0; a <= i; ++a) value += frame.edges[i][a] * frame.edges[i][a];
    value /= 2;
    for (int a = 0; a < i; ++a) value -= frame.edges[i][a] * c[a];
    c[i] = value / frame.edges[i][i];
    squared += c[i] * c[i];
  }
  return std::sqrt(squared);
}

// The volume of a simplex whose frame is known, length^j.
[[gnu::always_inline]] inline double FrameVolume(const SimplexFrame& frame, int j) {
  double volume = 1;
  for (int i = 0; i < j; ++i) volume *= frame.heights[i] / (i + 1);
  return volume;
}

// MeasureSimplex of j + 1 vertices, j >= 2, whose frame is known.
[[gnu::always_inline]] inline SimplexMeasures MeasureFramed(SimplexVertices vertices, int j, int d,
                                                            const SimplexFrame& frame) {
  SimplexMeasures m;
  m.dimension = j;
  double longest2 = 0;
  double shortest2 = std::numeric_limits<double>::infinity();
  for (int a = 0; a <= j; ++a) {
    for (int b = a + 1; b <= j; ++b) {
      const double e2 = SquaredDistance(vertices[a], vertices[b], d);
      longest2 = std::max(longest2, e2);
      shortest2 = std::min(shortest2, e2);
    }
  }
  m.diameter = std::sqrt(longest2);
  m.shortest_edge = std::sqrt(shortest2);
  m.volume = FrameVolume(frame, j);
  m.circumradius = FrameCircumradius(frame, j);
  return m;
}

// The trace of MeasureTilt, the sum of the squared sines of the principal angles: no less than the
// largest of them. REQUIRES: frame.rank == j.
[[gnu::always_inline]] inline double SumOfSquaredSines(const SimplexFrame& frame, int j, int d,
                                                       const double* tangent, int k) {
  double sum = 0;
  for (int a = 0; a < j; ++a) {
    double inside = 0;
    for (int b = 0; b < k; ++b) {
      const double cosine = Dot(tangent + b * d, frame.directions.data() + a * d, d);
      inside += cosine * cosine;
    }
    sum += 1 - inside;
  }
  return sum;
}

}  // namespace stellate::core
