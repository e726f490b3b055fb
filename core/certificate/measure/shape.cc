#include "core/certificate/measure/shape.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/base/dense.h"
#include "core/base/parallel.h"
#include "core/certificate/measure/corners.h"
#include "core/geometry/simplex_frame.h"
#include "core/specification.h"

namespace stellate::core {
namespace {

constexpr double kNegligible = 1e-14;  // difference of squared sines

// Raises `extreme` to at least `value`.
void Raise(std::atomic<double>& extreme, double value) {
  double known = extreme.load(std::memory_order_relaxed);
  while (known < value && !extreme.compare_exchange_weak(known, value, std::memory_order_relaxed)) {
  }
}

void Lower(std::atomic<double>& extreme, double value) {
  double known = extreme.load(std::memory_order_relaxed);
  while (known > value && !extreme.compare_exchange_weak(known, value, std::memory_order_relaxed)) {
  }
}

// What R1 bounds if a vertex has a protecting ball: the largest distance of a vertex from the
// orthocentre, the point of equal power to all vertices.
double RadiusAmongProtected(const MeshView& mesh, const std::uint32_t* ids) {
  const Eigen::Map<const Eigen::VectorXd> first(mesh.Point(ids[0]), mesh.d);
  Eigen::MatrixXd edges(mesh.d, mesh.k);
  Eigen::VectorXd powers(mesh.k);
  for (int i = 0; i < mesh.k; ++i) {
    const Eigen::Map<const Eigen::VectorXd> other(mesh.Point(ids[i + 1]), mesh.d);
    edges.col(i) = other - first;
    powers[i] = 0.5 * (edges.col(i).squaredNorm() + mesh.ProtectingRadius2(ids[0]) -
                       mesh.ProtectingRadius2(ids[i + 1]));
  }
  const Eigen::VectorXd centre = edges * SolveSymmetric(edges.transpose() * edges, powers);
  double radius = centre.norm();
  for (int i = 0; i < mesh.k; ++i) radius = std::max(radius, (centre - edges.col(i)).norm());
  return radius;
}

bool HasProtectedVertex(const MeshView& mesh, const std::uint32_t* ids) {
  return mesh.protecting_radii2 && std::any_of(ids, ids + mesh.k + 1, [&](std::uint32_t v) {
           return mesh.ProtectingRadius2(v) > 0;
         });
}

SimplexVertices FrameCorners(const MeshView& mesh, const std::uint32_t* ids, Corners& corners,
                             SimplexFrame& frame) {
  const SimplexVertices vertices = corners.Of(mesh, ids, mesh.k);
  frame.directions.resize(static_cast<std::size_t>(mesh.k) * static_cast<std::size_t>(mesh.d));
  WithDimension(mesh.d, [&](auto known) {
    TakeFrame(vertices, mesh.k, known() > 0 ? known() : mesh.d, frame);
  });
  return vertices;
}

// Whether all eigenvalues of the tilt are below `bound`, by a Cholesky factorisation of the
// difference.
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

// Returns the larger of `sine2` and the squared sine of the largest angle between the simplex and a
// tangent space at one of its vertices.
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
    const double sine = SineToTangent(frame, k, mesh.d, tangent, k);
    sine2 = std::max(sine2, sine * sine);
  }
  return sine2;
}

}  // namespace

ShapeSearch::ShapeSearch(const MeshView& mesh, const SimplexList& list) : mesh_(mesh), list_(list) {
  shape_.diameters.resize(list.size());
  shape_.tilts.resize(list.size());
}

void ShapeSearch::MeasureByFrame(std::uint32_t s, Worker* worker) {
  Corners corners;
  const SimplexVertices vertices = FrameCorners(mesh_, list_[s], corners, worker->frame);
  const SimplexMeasures m = MeasureSimplex(vertices, mesh_.d, worker->frame);
  const double radius =
      HasProtectedVertex(mesh_, list_[s]) ? RadiusAmongProtected(mesh_, list_[s]) : m.circumradius;
  const double ratio = m.RadiusEdgeRatio(), fatness = m.Fatness();
  Extremes* const found = &worker->found;
  if (radius > found->circumradius || (radius == found->circumradius && s < found->largest)) {
    found->circumradius = radius;
    found->largest = s;
  }
  if (ratio > found->radius_edge || (ratio == found->radius_edge && s < found->longest)) {
    found->radius_edge = ratio;
    found->longest = s;
  }
  found->fatness = std::min(found->fatness, fatness);
  Raise(radius2_, radius * radius);
  Raise(radius_edge2_, ratio * ratio);
  Lower(fatness2_, fatness * fatness);
}

double ShapeSearch::TiltByFrame(std::uint32_t s, std::uint32_t vertex, Worker* worker) const {
  Corners corners;
  FrameCorners(mesh_, list_[s], corners, worker->frame);
  if (worker->frame.rank < mesh_.k) return mesh_.k;
  return SumOfSquaredSines(worker->frame, mesh_.k, mesh_.d, mesh_.Tangent(vertex), mesh_.k);
}

double ShapeSearch::LargestTilt(std::uint32_t s, Worker* worker) const {
  double largest = 0;
  for (int i = 0; i <= mesh_.k; ++i)
    largest = std::max(largest, TiltByFrame(s, list_[s][i], worker));
  return largest;
}

// A simplex's tilt is the sum of the squared sines, an upper bound of the largest, so that few
// simplices need a second measurement.
double ShapeSearch::MaxSine2(float largest_tilt) const {
  // Rounding keeps the order.
  const auto may_reach = [&](std::uint32_t s, double sine2) {
    return shape_.tilts[s] >= static_cast<float>((sine2 - kTiltError) * (1 - kMargin));
  };
  const std::vector<std::uint32_t> first =
      ParallelGather<std::uint32_t>(list_.size(), [&](std::size_t s, auto* found) {
        const auto id = static_cast<std::uint32_t>(s);
        if (may_reach(id, largest_tilt)) found->push_back(id);
      });
  double most = -1;
  std::uint32_t most_tilted = 0;
  Worker worker;
  for (const std::uint32_t s : first) {
    const double tilt = LargestTilt(s, &worker);
    if (!(tilt > most)) continue;
    most = tilt;
    most_tilted = s;
  }
  Corners corners;
  const double start = LargerSine2(mesh_, list_, corners, most_tilted, 0);
  std::vector<double> parts(ChunkCount(list_.size()), start);
  ParallelChunks(list_.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    Corners own;
    double& sine2 = parts[chunk];
    for (auto s = static_cast<std::uint32_t>(begin); s < end; ++s)
      if (may_reach(s, sine2 + kNegligible)) sine2 = LargerSine2(mesh_, list_, own, s, sine2);
  });
  return *std::max_element(parts.begin(), parts.end());
}

MeshShape ShapeSearch::Conclude(const std::vector<Extremes>& parts) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  Extremes all;
  for (const Extremes& part : parts) {
    if (part.circumradius > all.circumradius ||
        (part.circumradius == all.circumradius && part.largest < all.largest)) {
      all.circumradius = part.circumradius;
      all.largest = part.largest;
    }
    if (part.radius_edge > all.radius_edge ||
        (part.radius_edge == all.radius_edge && part.longest < all.longest)) {
      all.radius_edge = part.radius_edge;
      all.longest = part.longest;
    }
    all.diameter = std::max(all.diameter, part.diameter);
    all.fatness = std::min(all.fatness, part.fatness);
    all.tilt = std::max(all.tilt, part.tilt);
  }
  shape_.max_circumradius = all.circumradius;
  shape_.largest = all.largest;
  shape_.max_diameter = all.diameter;
  shape_.max_radius_edge = all.radius_edge;
  shape_.min_fatness = std::min(shape_.min_fatness, all.fatness);
  if (mesh_.k == 2) {
    // An angle's sine is half the opposite edge over the circumradius: the smallest angle is where
    // the radius-edge ratio is largest.
    Corners corners;
    shape_.min_angle_degrees =
        SmallestTriangleAngle(corners.Of(mesh_, list_[all.longest], mesh_.k), mesh_.d) * kDegrees;
  }
  const double sine2 = MaxSine2(all.tilt);
  shape_.max_tangent_angle_degrees = std::asin(std::min(1.0, std::sqrt(sine2))) * kDegrees;
  return std::move(shape_);
}

}  // namespace stellate::core
