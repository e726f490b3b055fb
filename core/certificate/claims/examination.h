#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <set>
#include <vector>

#include "core/batch.h"
#include "core/certificate/complex/topology.h"
#include "core/certificate/findings.h"
#include "core/certificate/measure/shape.h"
#include "core/certificate/mesh_view.h"
#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {

// A mesh under examination: the inputs that all claims share, and what they have found so far. Each
// class of claims borrows one, and writes what it finds to `findings` and `certificate`.
struct Examination {
  Examination(const Specification& asked, const MeshView& view, const StarFacts& known)
      : spec(asked), mesh(view), facts(known) {}

  bool thorough() const { return spec.audit == Audit::kThorough; }
  bool graded() const { return facts.max_size_ratio > 0; }
  const SimplexList& list() const { return stars->list(); }
  Eigen::Map<const Eigen::VectorXd> Vertex(std::uint32_t v) const {
    return {mesh.Point(v), mesh.d};
  }
  Eigen::Map<const Eigen::MatrixXd> Tangents(std::uint32_t v) const {  // d x k
    return {mesh.Tangent(v), mesh.d, mesh.k};
  }
  // How far M may be from the mesh at a vertex, and from a point of a simplex.
  double LocalSize(std::uint32_t v) const;
  double DistanceAllowed(double circumradius) const;
  // Whether y (d) is a point that no mesh shows.
  bool IsLonePoint(const double* y) const;
  // Whether y (d) is a corner that the wall only touches: it has no simplex there.
  bool IsTouched(const double* y, int wall) const;
  // Writes Certificate::pinched_vertices, and a warning with the first place, from `pinched`.
  void ReportPinched();
  double Circumradius(const std::uint32_t* ids) const;

  const Specification spec;
  const MeshView mesh;
  const StarFacts facts;
  Certificate certificate;
  Findings findings;

  std::optional<VertexStars> stars;
  // Frees the stars, which take most of the certificate's memory, once no claim needs them.
  void ForgetStars() { stars.reset(); }
  // Whether some vertex of a simplex is on the boundary.
  bool AtBoundary(const std::uint32_t* ids) const {
    bool any = false;
    for (int i = 0; i <= mesh.k; ++i) any = any || mesh.WallsOf(ids[i]) != 0;
    return any;
  }
  MeshShape shape;
  std::vector<double> longest_edge;  // by vertex
  double size = 0;                   // the mesh's own: its largest circumradius, epsilon at most
  double position_error = 0;         // of the oracle, as seen at the vertices
  std::vector<double> seen;          // points of M that were answered, d each
  std::vector<double> wanted;  // points of M that the mesh should have a vertex nearer to, d each
  PointsOnWalls wanted_on_walls;    // where the mesh should end
  std::set<std::uint32_t> pinched;  // vertices, as of Certificate::pinched_vertices
};

// R1 is decided on circumradii in tangent spaces; rounding may differ.
inline constexpr double kSizeTolerance = 1e-6;

// Whether the answer to query j was found.
inline bool Found(const AnswerBlock& answer, Eigen::Index j) {
  return answer.found.empty() || answer.found[static_cast<std::size_t>(j)] != 0;
}

}  // namespace stellate::core
