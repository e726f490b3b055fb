#include "core/certificate/shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/geometry/simplex.h"
#include "core/specification.h"

namespace stellate::core {
namespace {

// Are all eigenvalues of the tilt below `bound`? Cholesky's factorisation of the difference.
bool TiltsLess(const TiltMatrix& tilt, int k, double bound) {
  TiltMatrix a = -tilt;
  for (int i = 0; i < k; ++i) a(i, i) += bound;
  for (int c = 0; c < k; ++c) {
    if (!(a(c, c) > 0)) return false;
    for (int r = c + 1; r < k; ++r) {
      const double factor = a(r, c) / a(c, c);
      for (int j = c + 1; j < k; ++j) a(r, j) -= factor * a(c, j);
    }
  }
  return true;
}

}  // namespace

MeshShape MeasureShape(const MeshView& mesh, const SimplexList& list) {
  const int k = mesh.k;
  const int d = mesh.d;
  constexpr double kNegligible = 1e-14;  // difference of squared sines
  constexpr double kDegrees = 180 / std::numbers::pi;
  MeshShape shape;
  shape.diameters.resize(list.size());
  shape.tilts.resize(list.size());
  double smallest_angle = std::numbers::pi;
  double largest_sine2 = 0;
  std::array<const double*, kMaxDimension + 1> corners{};
  const SimplexVertices vertices(corners.data(), static_cast<std::size_t>(k) + 1);
  for (std::uint32_t s = 0; s < list.size(); ++s) {
    for (int i = 0; i <= k; ++i) corners[i] = mesh.points + std::size_t{list[s][i]} * d;
    const SimplexFrame frame = FrameSimplex(vertices, d);
    const SimplexMeasures m = MeasureSimplex(vertices, d, frame);
    if (m.circumradius > shape.max_circumradius) {
      shape.max_circumradius = m.circumradius;
      shape.largest = s;
    }
    shape.max_diameter = std::max(shape.max_diameter, m.diameter);
    shape.max_radius_edge = std::max(shape.max_radius_edge, m.RadiusEdgeRatio());
    shape.min_fatness = std::min(shape.min_fatness, m.Fatness());
    if (k == 2) smallest_angle = std::min(smallest_angle, SmallestTriangleAngle(vertices, d));

    double tilt = 0;
    for (int i = 0; i <= k; ++i) {
      const double* tangent = mesh.tangents + std::size_t{list[s][i]} * d * k;
      if (frame.rank < k) {
        tilt = k;
        largest_sine2 = 1;
        continue;
      }
      const TiltMatrix matrix = MeasureTilt(frame, k, d, tangent, k);
      double sum = 0;
      for (int a = 0; a < k; ++a) sum += matrix(a, a);
      tilt = std::max(tilt, sum);
      // The angle itself is dearer, and seldom a new maximum.
      if (TiltsLess(matrix, k, largest_sine2 + kNegligible)) continue;
      const double sine = std::sin(AngleToTangent(frame, k, d, tangent, k));
      largest_sine2 = std::max(largest_sine2, sine * sine);
    }
    shape.diameters[s] = m.diameter;
    shape.tilts[s] = tilt;
  }
  shape.min_angle_degrees = k == 2 && list.size() > 0 ? smallest_angle * kDegrees : 0;
  shape.max_tangent_angle_degrees = std::asin(std::min(1.0, std::sqrt(largest_sine2))) * kDegrees;
  return shape;
}

}  // namespace stellate::core
