#include "core/geometry/simplex.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "core/sample/vector_ops.h"

namespace stellate::core {
namespace {

constexpr int kMaxVertices = kMaxSimplexDimension + 1;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
// A height this small beside the diameter is rounding error: the simplex is degenerate.
constexpr double kDegenerateHeight = 1e-14;

// The circumcentre c of vertex 0 and the edges r_i, upper triangular: 2 r_i . c = |r_i|^2.
double FrameCircumradius(const SimplexFrame& frame, int j) {
  if (frame.rank < j) return kInfinity;
  std::array<double, kMaxSimplexDimension> c{};
  double squared = 0;
  for (int i = 0; i < j; ++i) {
    double value = frame.edges.col(i).head(i + 1).squaredNorm() / 2;
    for (int a = 0; a < i; ++a) value -= frame.edges(a, i) * c[a];
    c[i] = value / frame.edges(i, i);
    squared += c[i] * c[i];
  }
  return std::sqrt(squared);
}

// Calls visit(face) for each face of dimension `lowest` or more but the simplex itself, until one
// returns true; returns whether one did.
template <typename Visit>
bool AnyProperFace(SimplexVertices vertices, int lowest, Visit&& visit) {
  const unsigned n = static_cast<unsigned>(vertices.size());
  const unsigned whole = (1u << n) - 1;
  for (unsigned mask = 1; mask < whole; ++mask) {
    std::array<const double*, kMaxVertices> face{};
    int count = 0;
    for (unsigned i = 0; i < n; ++i) {
      if (mask >> i & 1u) face[count++] = vertices[i];
    }
    if (count - 1 >= lowest && visit(SimplexVertices(face.data(), count))) return true;
  }
  return false;
}

}  // namespace

double SimplexMeasures::RadiusEdgeRatio() const {
  if (dimension == 0) return 0;
  return shortest_edge > 0 ? circumradius / shortest_edge : kInfinity;
}

double SimplexMeasures::Fatness() const {
  if (dimension == 0) return 1;
  if (!(diameter > 0)) return 0;
  return volume / std::pow(diameter, dimension);
}

SimplexFrame FrameSimplex(SimplexVertices vertices, int d) {
  const int j = static_cast<int>(vertices.size()) - 1;
  const std::size_t width = static_cast<std::size_t>(d);
  SimplexFrame frame;
  frame.edges.setZero();
  frame.directions.resize(static_cast<std::size_t>(j) * width);
  double* const e = frame.directions.data();
  double longest = 0;
  for (int a = 0; a < j; ++a) {
    for (int i = 0; i < d; ++i) e[a * d + i] = vertices[a + 1][i] - vertices[0][i];
    longest = std::max(longest, Dot(e + a * d, e + a * d, d));
  }
  longest = std::sqrt(longest);

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
    if (farthest != step) {
      std::swap_ranges(e + step * d, e + (step + 1) * d, e + farthest * d);
      frame.edges.col(step).swap(frame.edges.col(farthest));
    }
    double* const u = e + step * d;
    for (int b = 0; b < step; ++b) {
      const double s = Dot(u, e + b * d, d);
      frame.edges(b, step) += s;
      for (int i = 0; i < d; ++i) u[i] -= s * e[b * d + i];
    }
    const double height = std::sqrt(Dot(u, u, d));
    if (!(height > kDegenerateHeight * longest)) return frame;
    frame.heights[step] = height;
    frame.edges(step, step) = height;
    for (int i = 0; i < d; ++i) u[i] /= height;
    for (int a = step + 1; a < j; ++a) {
      const double s = Dot(e + a * d, u, d);
      frame.edges(step, a) = s;
      for (int i = 0; i < d; ++i) e[a * d + i] -= s * u[i];
    }
    ++frame.rank;
  }
  return frame;
}

SimplexMeasures MeasureSimplex(SimplexVertices vertices, int d) {
  return MeasureSimplex(vertices, d, FrameSimplex(vertices, d));
}

SimplexMeasures MeasureSimplex(SimplexVertices vertices, int d, const SimplexFrame& frame) {
  SimplexMeasures m;
  m.dimension = static_cast<int>(vertices.size()) - 1;
  if (m.dimension == 0) return m;

  double longest2 = 0;
  double shortest2 = kInfinity;
  for (std::size_t a = 0; a < vertices.size(); ++a) {
    for (std::size_t b = a + 1; b < vertices.size(); ++b) {
      const double e2 = SquaredDistance(vertices[a], vertices[b], d);
      longest2 = std::max(longest2, e2);
      shortest2 = std::min(shortest2, e2);
    }
  }
  m.diameter = std::sqrt(longest2);
  m.shortest_edge = std::sqrt(shortest2);
  if (m.dimension == 1) {
    m.volume = m.diameter;
    m.circumradius = m.diameter > 0 ? m.diameter / 2 : kInfinity;
    return m;
  }
  for (int i = 0; i < m.dimension; ++i) m.volume *= frame.heights[i] / (i + 1);
  m.circumradius = FrameCircumradius(frame, m.dimension);
  return m;
}

bool IsFat(SimplexVertices vertices, int d, double theta0) {
  const SimplexMeasures m = MeasureSimplex(vertices, d);
  return m.Fatness() >= std::pow(theta0, m.dimension);
}

bool IsSliver(SimplexVertices vertices, int d, double theta0) {
  if (vertices.size() < 3 || IsFat(vertices, d, theta0)) return false;
  return !AnyProperFace(vertices, 1, [&](SimplexVertices face) { return !IsFat(face, d, theta0); });
}

bool ContainsSliver(SimplexVertices vertices, int d, double theta0) {
  return IsSliver(vertices, d, theta0) || AnyProperFace(vertices, 2, [&](SimplexVertices face) {
           return IsSliver(face, d, theta0);
         });
}

TiltMatrix MeasureTilt(const SimplexFrame& frame, int j, int d, const double* tangent, int k) {
  std::array<std::array<double, kMaxSimplexDimension>, kMaxSimplexDimension> cosines{};
  for (int a = 0; a < j; ++a) {
    const double* q = frame.directions.data() + a * d;
    for (int b = 0; b < k; ++b) cosines[a][b] = Dot(tangent + b * d, q, d);
  }
  TiltMatrix tilt = TiltMatrix::Zero();
  for (int a = 0; a < j; ++a) {
    for (int b = 0; b <= a; ++b) {
      double dot = 0;
      for (int c = 0; c < k; ++c) dot += cosines[a][c] * cosines[b][c];
      tilt(a, b) = tilt(b, a) = (a == b ? 1 : 0) - dot;
    }
  }
  return tilt;
}

double AngleToTangent(const SimplexFrame& frame, int j, int d, const double* tangent, int k) {
  if (j == 0) return 0;
  if (frame.rank < j || j > k) return std::numbers::pi / 2;

  // The residuals n = q - T T^t q of the directions q; their largest singular value is the sine.
  std::vector<double> residuals(frame.directions);
  for (int a = 0; a < j; ++a) {
    const double* q = frame.directions.data() + a * d;
    double* n = residuals.data() + a * d;
    for (int b = 0; b < k; ++b) {
      const double along = Dot(tangent + b * d, q, d);
      for (int i = 0; i < d; ++i) n[i] -= along * tangent[b * d + i];
    }
  }
  Eigen::MatrixXd gram(j, j);
  for (int a = 0; a < j; ++a) {
    for (int b = 0; b < j; ++b) gram(a, b) = Dot(&residuals[a * d], &residuals[b * d], d);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(gram, Eigen::EigenvaluesOnly);
  const double sine2 = std::clamp(solver.eigenvalues()[j - 1], 0.0, 1.0);
  return std::asin(std::sqrt(sine2));
}

double AngleToTangent(SimplexVertices vertices, int d, const double* tangent, int k) {
  return AngleToTangent(FrameSimplex(vertices, d), static_cast<int>(vertices.size()) - 1, d,
                        tangent, k);
}

double SmallestTriangleAngle(SimplexVertices vertices, int d) {
  double smallest = std::numbers::pi;
  for (int a = 0; a < 3; ++a) {
    const double* p = vertices[a];
    const double* q = vertices[(a + 1) % 3];
    const double* r = vertices[(a + 2) % 3];
    // The half-angle form |u' - v'| / |u' + v'| with unit u', v' is exact for small angles too.
    const double lu = Distance(p, q, d);
    const double lv = Distance(p, r, d);
    if (!(lu > 0 && lv > 0)) return 0;
    double minus2 = 0, plus2 = 0;
    for (int i = 0; i < d; ++i) {
      const double u = (q[i] - p[i]) / lu;
      const double v = (r[i] - p[i]) / lv;
      minus2 += (u - v) * (u - v);
      plus2 += (u + v) * (u + v);
    }
    smallest = std::min(smallest, 2 * std::atan2(std::sqrt(minus2), std::sqrt(plus2)));
  }
  return smallest;
}

}  // namespace stellate::core
