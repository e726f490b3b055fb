#include "core/certificate/shape.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/base/parallel.h"
#include "core/certificate/corners.h"
#include "core/geometry/simplex_frame.h"
#include "core/specification.h"

namespace stellate::core {
namespace {

constexpr double kNegligible = 1e-14;  // difference of squared sines

// Of some of the simplices.
struct Extremes {
  double circumradius = 0, diameter = 0, radius_edge = 0;
  double fatness = std::numeric_limits<double>::infinity();
  double tilt = -1;
  std::uint32_t largest = 0, longest = 0, most_tilted = 0;  // of circumradius, radius-edge, tilt

  void Take(const Extremes& other) {
    if (other.circumradius > circumradius) {
      circumradius = other.circumradius;
      largest = other.largest;
    }
    if (other.radius_edge > radius_edge) {
      radius_edge = other.radius_edge;
      longest = other.longest;
    }
    if (other.tilt > tilt) {
      tilt = other.tilt;
      most_tilted = other.most_tilted;
    }
    diameter = std::max(diameter, other.diameter);
    fatness = std::min(fatness, other.fatness);
  }
};

// What R1 bounds where a vertex is guarded: the largest distance of a vertex from the orthocentre,
// from which all have the same power.
double RadiusAmongGuards(const MeshView& mesh, const std::uint32_t* ids) {
  const Eigen::Map<const Eigen::VectorXd> first(mesh.Point(ids[0]), mesh.d);
  Eigen::MatrixXd edges(mesh.d, mesh.k);
  Eigen::VectorXd powers(mesh.k);
  for (int i = 0; i < mesh.k; ++i) {
    const Eigen::Map<const Eigen::VectorXd> other(mesh.Point(ids[i + 1]), mesh.d);
    edges.col(i) = other - first;
    powers[i] =
        0.5 * (edges.col(i).squaredNorm() + mesh.GuardOf(ids[0]) - mesh.GuardOf(ids[i + 1]));
  }
  const Eigen::VectorXd centre = edges * (edges.transpose() * edges).ldlt().solve(powers).eval();
  double radius = centre.norm();
  for (int i = 0; i < mesh.k; ++i) radius = std::max(radius, (centre - edges.col(i)).norm());
  return radius;
}

bool IsAmongGuards(const MeshView& mesh, const std::uint32_t* ids) {
  return mesh.guards &&
         std::any_of(ids, ids + mesh.k + 1, [&](std::uint32_t v) { return mesh.GuardOf(v) > 0; });
}

// k and d are constants where they are usual.
[[gnu::always_inline]] inline Extremes MeasurePart(const MeshView& mesh, const SimplexList& list,
                                                   std::uint32_t begin, std::uint32_t end, int k,
                                                   int d, MeshShape& shape) {
  Extremes part;
  Corners corners;
  SimplexFrame frame;
  frame.directions.resize(static_cast<std::size_t>(k) * static_cast<std::size_t>(d));
  for (std::uint32_t s = begin; s < end; ++s) {
    const SimplexVertices vertices = corners.Of(mesh, list[s], k);
    TakeFrame(vertices, k, d, frame);
    const SimplexMeasures m =
        k > 1 ? MeasureFramed(vertices, k, d, frame) : MeasureSimplex(vertices, d, frame);
    const double radius =
        IsAmongGuards(mesh, list[s]) ? RadiusAmongGuards(mesh, list[s]) : m.circumradius;
    Extremes one{radius, m.diameter, m.RadiusEdgeRatio(), m.Fatness(), 0, s, s, s};
    for (int i = 0; i <= k; ++i) {
      const double tilt =
          frame.rank < k ? k : SumOfSquaredSines(frame, k, d, mesh.Tangent(list[s][i]), k);
      one.tilt = std::max(one.tilt, tilt);
    }
    part.Take(one);
    shape.diameters[s] = static_cast<float>(m.diameter);
    shape.tilts[s] = static_cast<float>(one.tilt);
  }
  return part;
}

template <int K>
Extremes MeasurePart(const MeshView& mesh, const SimplexList& list, std::uint32_t begin,
                     std::uint32_t end, MeshShape& shape) {
  return WithDimension(mesh.d, [&](auto known) {
    const int d = known() > 0 ? known() : mesh.d;
    return MeasurePart(mesh, list, begin, end, K, d, shape);
  });
}

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

// The larger of `sine2` and the squared sine of the largest angle between the simplex and a tangent
// space at a vertex of it.
double LargerSine2(const MeshView& mesh, const SimplexList& list, Corners& corners, std::uint32_t s,
                   double sine2) {
  const int k = mesh.k;
  const SimplexFrame frame = FrameSimplex(corners.Of(mesh, list[s], k), mesh.d);
  if (frame.rank < k) return 1;
  for (int i = 0; i <= k; ++i) {
    const double* tangent = mesh.Tangent(list[s][i]);
    const double bound = sine2 + kNegligible;
    if (SumOfSquaredSines(frame, k, mesh.d, tangent, k) < bound) continue;
    // The angle itself costs more, and is seldom a new maximum.
    if (TiltsLess(MeasureTilt(frame, k, mesh.d, tangent, k), k, bound)) continue;
    const double sine = std::sin(AngleToTangent(frame, k, mesh.d, tangent, k));
    sine2 = std::max(sine2, sine * sine);
  }
  return sine2;
}

// A simplex' tilt is the sum of the squared sines that the largest is sought of, so that few need
// a second look.
double MaxSine2(const MeshView& mesh, const SimplexList& list, const MeshShape& shape,
                std::uint32_t most_tilted) {
  Corners corners;
  const double start = LargerSine2(mesh, list, corners, most_tilted, 0);
  std::vector<double> parts(ChunkCount(list.size()), start);
  ParallelChunks(list.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    Corners own;
    double& sine2 = parts[chunk];
    for (std::size_t s = begin; s < end; ++s) {
      // Rounding keeps the order.
      if (shape.tilts[s] < static_cast<float>(sine2 + kNegligible)) continue;
      sine2 = LargerSine2(mesh, list, own, static_cast<std::uint32_t>(s), sine2);
    }
  });
  return *std::max_element(parts.begin(), parts.end());
}

}  // namespace

MeshShape MeasureShape(const MeshView& mesh, const SimplexList& list) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  MeshShape shape;
  if (list.size() == 0) return shape;
  shape.diameters.resize(list.size());
  shape.tilts.resize(list.size());
  std::vector<Extremes> parts(ChunkCount(list.size()));
  ParallelChunks(list.size(), [&](std::size_t chunk, std::size_t from, std::size_t to) {
    const auto begin = static_cast<std::uint32_t>(from), end = static_cast<std::uint32_t>(to);
    parts[chunk] = mesh.k == 2   ? MeasurePart<2>(mesh, list, begin, end, shape)
                   : mesh.k == 3 ? MeasurePart<3>(mesh, list, begin, end, shape)
                                 : MeasurePart(mesh, list, begin, end, mesh.k, mesh.d, shape);
  });
  Extremes all;
  for (const Extremes& part : parts) all.Take(part);
  shape.max_circumradius = all.circumradius;
  shape.largest = all.largest;
  shape.max_diameter = all.diameter;
  shape.max_radius_edge = all.radius_edge;
  shape.min_fatness = std::min(shape.min_fatness, all.fatness);
  if (mesh.k == 2) {
    // An angle's sine is half the opposite edge over the circumradius: the smallest angle is where
    // the radius-edge ratio is largest.
    Corners corners;
    shape.min_angle_degrees =
        SmallestTriangleAngle(corners.Of(mesh, list[all.longest], mesh.k), mesh.d) * kDegrees;
  }
  const double sine2 = MaxSine2(mesh, list, shape, all.most_tilted);
  shape.max_tangent_angle_degrees = std::asin(std::min(1.0, std::sqrt(sine2))) * kDegrees;
  return shape;
}

}  // namespace stellate::core
