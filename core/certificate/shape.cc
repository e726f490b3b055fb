#include "core/certificate/shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/geometry/simplex.h"
#include "core/parallel.h"
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

// Of some of the simplices.
struct Extremes {
  double circumradius = 0, diameter = 0, radius_edge = 0;
  double fatness = std::numeric_limits<double>::infinity();
  double angle = std::numbers::pi;
  double sine2 = 0;           // of the angle to the tangent spaces
  std::uint32_t largest = 0;  // where the circumradius is attained
};

Extremes MeasurePart(const MeshView& mesh, const SimplexList& list, std::uint32_t begin,
                     std::uint32_t end, std::vector<float>& diameters, std::vector<float>& tilts) {
  const int k = mesh.k;
  const int d = mesh.d;
  constexpr double kNegligible = 1e-14;  // difference of squared sines
  Extremes part;
  std::array<const double*, kMaxDimension + 1> corners{};
  const SimplexVertices vertices(corners.data(), static_cast<std::size_t>(k) + 1);
  for (std::uint32_t s = begin; s < end; ++s) {
    for (int i = 0; i <= k; ++i) corners[i] = mesh.Point(list[s][i]);
    const SimplexFrame frame = FrameSimplex(vertices, d);
    const SimplexMeasures m = MeasureSimplex(vertices, d, frame);
    if (m.circumradius > part.circumradius) {
      part.circumradius = m.circumradius;
      part.largest = s;
    }
    part.diameter = std::max(part.diameter, m.diameter);
    part.radius_edge = std::max(part.radius_edge, m.RadiusEdgeRatio());
    part.fatness = std::min(part.fatness, m.Fatness());
    if (k == 2) part.angle = std::min(part.angle, SmallestTriangleAngle(vertices, d));

    double tilt = 0;
    for (int i = 0; i <= k; ++i) {
      const double* tangent = mesh.Tangent(list[s][i]);
      if (frame.rank < k) {
        tilt = k;
        part.sine2 = 1;
        continue;
      }
      const TiltMatrix matrix = MeasureTilt(frame, k, d, tangent, k);
      double sum = 0;
      for (int a = 0; a < k; ++a) sum += matrix(a, a);
      tilt = std::max(tilt, sum);
      // The angle itself is dearer, and seldom a new maximum.
      if (TiltsLess(matrix, k, part.sine2 + kNegligible)) continue;
      const double sine = std::sin(AngleToTangent(frame, k, d, tangent, k));
      part.sine2 = std::max(part.sine2, sine * sine);
    }
    diameters[s] = static_cast<float>(m.diameter);
    tilts[s] = static_cast<float>(tilt);
  }
  return part;
}

}  // namespace

MeshShape MeasureShape(const MeshView& mesh, const SimplexList& list) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  MeshShape shape;
  shape.diameters.resize(list.size());
  shape.tilts.resize(list.size());
  std::vector<Extremes> parts(ChunkCount(list.size()));
  ParallelChunks(list.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    parts[chunk] = MeasurePart(mesh, list, static_cast<std::uint32_t>(begin),
                               static_cast<std::uint32_t>(end), shape.diameters, shape.tilts);
  });
  Extremes all;
  for (const Extremes& part : parts) {
    if (part.circumradius > all.circumradius) {
      all.circumradius = part.circumradius;
      all.largest = part.largest;
    }
    all.diameter = std::max(all.diameter, part.diameter);
    all.radius_edge = std::max(all.radius_edge, part.radius_edge);
    all.fatness = std::min(all.fatness, part.fatness);
    all.angle = std::min(all.angle, part.angle);
    all.sine2 = std::max(all.sine2, part.sine2);
  }
  shape.max_circumradius = all.circumradius;
  shape.largest = all.largest;
  shape.max_diameter = all.diameter;
  shape.max_radius_edge = all.radius_edge;
  shape.min_fatness = std::min(shape.min_fatness, all.fatness);
  shape.min_angle_degrees = mesh.k == 2 && list.size() > 0 ? all.angle * kDegrees : 0;
  shape.max_tangent_angle_degrees = std::asin(std::min(1.0, std::sqrt(all.sine2))) * kDegrees;
  return shape;
}

}  // namespace stellate::core
