#include "core/certificate/claims/examination.h"

#include <algorithm>
#include <array>

#include "core/base/message.h"
#include "core/base/name_point.h"
#include "core/base/vector_ops.h"
#include "core/geometry/simplex.h"
#include "core/geometry/simplex_frame.h"

namespace stellate::core {
namespace {

// A point of a simplex of circumradius R with vertices on M is within reach - sqrt(reach^2 - R^2)
// of M: 0.27 R at R = 0.5 reach, half of R at 0.8 reach. A larger distance means that M is
// elsewhere.
constexpr double kDistanceShare = 0.5;
constexpr double kDistanceNoise = 0.02;  // of the mesh size, for inexact oracles

}  // namespace

double Examination::LocalSize(std::uint32_t v) const {
  return graded() ? std::min(size, longest_edge[v]) : size;
}

double Examination::DistanceAllowed(double circumradius) const {
  return kDistanceShare * std::min(circumradius, spec.epsilon) + kDistanceNoise * size;
}

bool Examination::IsLonePoint(const double* y) const {
  const auto d = static_cast<std::size_t>(mesh.d);
  for (std::size_t i = 0; i < facts.lone_points.size(); i += d)
    if (Distance(facts.lone_points.data() + i, y, mesh.d) <= facts.same_point) return true;
  return false;
}

bool Examination::IsTouched(const double* y, int wall) const {
  const auto d = static_cast<std::size_t>(mesh.d);
  const PointsOnWalls& touches = facts.touches;
  for (std::size_t i = 0; i < touches.walls.size(); ++i)
    if (IsSubset(SetOfWall(wall), touches.walls[i]) &&
        Distance(touches.points.data() + i * d, y, mesh.d) <= facts.same_point)
      return true;
  return false;
}

void Examination::ReportPinched() {
  certificate.pinched_vertices = pinched.size();
  if (pinched.empty()) return;
  findings.Warn(Message(
      "Pinched at ", pinched.size(), pinched.size() == 1 ? " vertex" : " vertices",
      ", the first at ", NamePoint(Vertex(*pinched.begin())),
      ": the manifold, or a region of it, touches itself there in an edge or a point alone."));
}

double Examination::Circumradius(const std::uint32_t* ids) const {
  std::array<const double*, kMaxDimension + 1> corners{};
  for (int i = 0; i <= mesh.k; ++i) corners[i] = mesh.Point(ids[i]);
  const SimplexVertices vertices{corners.data(), static_cast<std::size_t>(mesh.k) + 1};
  if (mesh.k == 1) return MeasureSimplex(vertices, mesh.d).circumradius;
  SimplexFrame frame;
  frame.directions.resize(static_cast<std::size_t>(mesh.k) * static_cast<std::size_t>(mesh.d));
  WithDimension(mesh.d, [&](auto known) {
    TakeFrame(vertices, mesh.k, known() > 0 ? known() : mesh.d, frame);
  });
  return FrameCircumradius(frame, mesh.k);
}

}  // namespace stellate::core
