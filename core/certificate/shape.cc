#include "core/certificate/shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/geometry/simplex.h"
#include "core/specification.h"

namespace stellate::core {

MeshShape MeasureShape(const MeshView& mesh, const SimplexList& list) {
  const int k = mesh.k;
  const int d = mesh.d;
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
      const double bound = SumOfSquaredSines(frame, k, d, tangent, k);
      tilt = std::max(tilt, bound);
      // The angle itself is dearer, and seldom a new maximum.
      if (bound <= largest_sine2) continue;
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
