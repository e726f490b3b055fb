#include "core/geometry/simplex.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/base/dense.h"
#include "core/base/infinity.h"
#include "core/base/power.h"
#include "core/base/vector_ops.h"
#include "core/geometry/simplex_frame.h"

namespace stellate::core {
namespace {

constexpr int kMaxVertices = kMaxSimplexDimension + 1;
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
  double power = diameter;
  for (int i = 1; i < dimension; ++i) power *= diameter;
  return volume / power;
}

SimplexFrame FrameSimplex(SimplexVertices vertices, int d) {
  const int j = static_cast<int>(vertices.size()) - 1;
  SimplexFrame frame;
  frame.directions.resize(static_cast<std::size_t>(j) * static_cast<std::size_t>(d));
  TakeFrame(vertices, j, d, frame);
  return frame;
}

SimplexMeasures MeasureSimplex(SimplexVertices vertices, int d) {
  return MeasureSimplex(vertices, d, FrameSimplex(vertices, d));
}

SimplexMeasures MeasureSimplex(SimplexVertices vertices, int d, const SimplexFrame& frame) {
  SimplexMeasures m;
  m.dimension = static_cast<int>(vertices.size()) - 1;
  if (m.dimension == 0) return m;

  if (m.dimension == 1) {
    m.diameter = m.shortest_edge = m.volume = Distance(vertices[0], vertices[1], d);
    m.circumradius = m.diameter > 0 ? m.diameter / 2 : kInfinity;
    return m;
  }
  return MeasureFramed(vertices, m.dimension, d, frame);
}

bool IsFat(SimplexVertices vertices, int d, double theta0) {
  const SimplexMeasures m = MeasureSimplex(vertices, d);
  return m.Fatness() >= Power(theta0, m.dimension);
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

double SineToTangent(const SimplexFrame& frame, int j, int d, const double* tangent, int k) {
  if (j == 0) return 0;
  if (frame.rank < j || j > k) return 1;

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
  return std::sqrt(std::clamp(EigenvaluesOfSymmetric(gram)[j - 1], 0.0, 1.0));
}

double AngleToTangent(const SimplexFrame& frame, int j, int d, const double* tangent, int k) {
  return std::asin(SineToTangent(frame, j, d, tangent, k));
}

double AngleToTangent(SimplexVertices vertices, int d, const double* tangent, int k) {
  return AngleToTangent(FrameSimplex(vertices, d), static_cast<int>(vertices.size()) - 1, d,
                        tangent, k);
}

double SmallestTriangleAngle(SimplexVertices vertices, int d) {
  // It is opposite the shortest edge.
  int at = 0;
  double shortest2 = kInfinity;
  for (int a = 0; a < 3; ++a) {
    const double e2 = SquaredDistance(vertices[(a + 1) % 3], vertices[(a + 2) % 3], d);
    if (e2 < shortest2) {
      shortest2 = e2;
      at = a;
    }
  }
  const double* p = vertices[at];
  const double* q = vertices[(at + 1) % 3];
  const double* r = vertices[(at + 2) % 3];
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
  return 2 * std::atan2(std::sqrt(minus2), std::sqrt(plus2));
}

}  // namespace stellate::core
