#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/places.h"
#include "core/status.h"
#include "core/walls.h"

namespace stellate::core {

// How a run ended. Only kConverged can leave a certified mesh.
enum class Termination {
  kRunning = 0,
  kConverged,     // no rule is broken
  kVertexBudget,  // Limits::max_vertices reached
  kRoundBudget,   // Limits::max_rounds reached
  kCancelled,     // Mesher::Cancel was called
  kOracleFailed,  // Mesher::Fail was called, or no seed has a closest point
  kNoProgress,    // rules are still broken, but refinement no longer helps; see Counts
};
const char* TerminationName(Termination t);  // "CONVERGED", ...

enum class Phase { kSeeding = 0, kRefining, kCertifying, kDone };
const char* PhaseName(Phase p);  // "SEEDING", ...

// The state of a running mesh, cheap to read. It is final after the last round.
//
//   const Progress& now = mesher->progress();
//   std::cerr << PhaseName(now.phase) << ": " << 100 * now.fraction << " %\n";
struct Progress {
  Phase phase = Phase::kSeeding;
  std::uint64_t round = 0;    // batches absorbed
  std::uint64_t queries = 0;  // answered so far
  std::uint64_t vertices = 0;
  std::uint64_t simplices = 0;
  std::uint64_t unbounded_stars = 0;   // stars on the advancing front
  std::uint64_t bad_size = 0;          // stars with a simplex that breaks R1
  std::uint64_t bad_radius_edge = 0;   // ... R2
  std::uint64_t bad_sliver = 0;        // ... R3
  std::uint64_t bad_inconsistent = 0;  // ... R4; R3 and R4 are counted once R1 and R2 hold
  std::uint64_t bad_protection = 0;    // ... R5, which is counted once all others hold
  double fraction = 0;                 // estimated share of the work done, 0..1; never falls
  bool is_foreseeable = false;         // the fraction allows to estimate how long the rest takes
};

// What changed in one round. Vertex ids count up from 0 and never change. While the mesh grows, it
// contains a simplex if the star of its lowest vertex does; once all stars are consistent that is
// the union of the stars. For k >= 4 the last delta may replace the few simplices about which stars
// still disagree (core/complex/cavities.h).
//
// Take what is removed out before you put in what is added:
//
//   for (const auto& ids : TrianglesOf(delta.removed)) triangles.erase(ids);
//   for (const auto& ids : TrianglesOf(delta.added)) triangles.insert(ids);
struct MeshDelta {
  std::uint64_t revision = 0;                 // 1, 2, ...: one a round
  std::uint64_t first_vertex = 0;             // id of the first new vertex
  Eigen::MatrixXd points;                     // d x (new vertices)
  std::vector<std::uint32_t> added, removed;  // simplices, k+1 ascending vertex ids each
  std::vector<WallSet> walls;                 // of each new vertex; empty where none is on a wall
  std::vector<std::int8_t> labels;            // of each added simplex; empty without labels
};

// Of the boundary alone (Specification::boundary_only) simplices have k ids. Each has two labels:
// those that the normal of its row of ids points away from and into, 0 being outside of M, 1 being
// M without labels; where M does not fill space (k < d), those of its wall's positive and negative
// side.

// What a run took.
struct Counts {
  std::uint64_t vertices = 0, simplices = 0;
  std::uint64_t rounds = 0;                 // batches asked, certificate included
  std::uint64_t queries = 0;                // closest points and intersections, tangents excluded
  std::uint64_t tangent_queries = 0;        // closest points spent on finding tangent bases
  std::uint64_t inserted_size = 0;          // points inserted by rule R1 (the front included)
  std::uint64_t inserted_radius_edge = 0;   // R2
  std::uint64_t inserted_sliver = 0;        // R3
  std::uint64_t inserted_inconsistent = 0;  // R4
  std::uint64_t inserted_protection = 0;    // R5
  std::uint64_t duplicates = 0;             // answers that fell on an existing sample point
};

// The mesh of a face: its simplices, dimension + 1 ascending vertex ids each, sorted; all vertices
// are on the face's walls. The boundary is the union of the faces of one wall.
struct FaceMesh {
  WallSet walls = 0;
  int dimension = 0;
  std::vector<std::uint32_t> simplices;
  // Of a face of one wall: the labels on its negative and its positive side. Without labels, what
  // is beyond a wall has the label 0, and M the label 1.
  std::pair<int, int> sides = {0, 1};
  // Of a face of one wall where the inside is not meshed (Specification::boundary_only), else
  // empty. By simplex: the signs of the other walls; the label that the normal of its row of ids
  // points away from; and the wall's outward conormals at its vertices, d each.
  std::vector<WallSet> signs;
  std::vector<std::int8_t> behind;
  std::vector<double> conormals;
};

// A face in the certificate.
struct FaceReport {
  WallSet walls = 0;
  int dimension = 0;
  std::uint64_t simplices = 0;
  std::uint64_t components = 0;
  std::int64_t euler_characteristic = 0;
  std::pair<int, int> sides = {0, 1};  // as of FaceMesh
  double volume = 0;                // length^dimension: an area, a length; of corners their number
  std::vector<std::int64_t> betti;  // over Z/2, from dimension 0 on; empty: not computed
};

// A region of an arrangement of walls in the certificate: the part of M with one label. Of a
// boundary alone (Specification::boundary_only) the region's surface, except the volume.
struct RegionReport {
  int label = 0;
  std::uint64_t simplices = 0;
  std::uint64_t components = 0;
  std::int64_t euler_characteristic = 0;
  double volume = 0;                // length^k; 0 of a boundary alone, if M does not fill space
  double min_dihedral_degrees = 0;  // the least angle between facets of a simplex; of k = 1, 0
  std::vector<std::int64_t> betti;  // over Z/2, from dimension 0 on; empty: not computed
};

// A place where two walls meet: a point of M, and the angle between the walls there, inside M.
struct WallAngle {
  WallSet walls = 0;  // the two
  double degrees = 0;
  Eigen::VectorXd point;
};

// How far a certificate goes.
enum class CertificateLevel {
  kRefused = 0,  // a check failed, or the run did not converge
  kDecided,      // of reconstructions: it is a manifold, but the points say too little of M; not
                 // certified
  kSampled,      // every check passed; some look at samples
  kProved,       // and a theorem holds, of the declared reach alone
};
const char* CertificateLevelName(CertificateLevel level);  // "SAMPLED", ...

// The places where a mesh is wrong: the first of each kind that the certificate counts, in
// ascending order.
struct Violations {
  static constexpr std::size_t kMost = 100;  // of each kind

  // The faces that are not in exactly two simplices, k vertex ids each. In a mesh with boundary,
  // the number of vertices stands as an id for what is beyond the boundary.
  std::vector<std::uint32_t> faces;
  std::vector<std::uint32_t> links;         // vertices whose link is no sphere, or that have none
  std::vector<std::uint32_t> stars;         // vertices whose star overlaps itself, projected
  std::vector<std::uint32_t> inconsistent;  // vertices whose star holds a simplex that others lack
  std::vector<std::uint32_t> fibres;        // vertices near which a normal flat fails; ascending
};

// How well a finished mesh is protected, where Criteria::protection asks for that
// (docs/using/protection.md). The gap of a simplex is how much farther than its circumradius the
// nearest other vertex is from its centre: from the centre where stars judge it, and from the worst
// of them, where that is one in each vertex's tangent space.
struct ProtectionReport {
  double asked = 0;                  // length
  double least = 0;                  // gap, length; below 0: a ball is not empty
  double percentile = 0;             // gap that 99 % of the simplices have or exceed, length
  double median = 0;                 // gap, length
  double least_ratio = 0;            // least gap / circumradius
  std::uint64_t weak = 0;            // simplices whose gap is less than asked
  std::vector<std::uint32_t> worst;  // the simplex with the least gap: k+1 vertex ids
  // Vertices that each move by less than this, a length, change no simplex of the mesh.
  double stability_radius = 0;
  // No simplex has a height of less than this share of k times its longest edge.
  double thickness_bound = 0;
  // If the reach is as declared, the intrinsic and the restricted Delaunay complex of the vertices,
  // and their stars in tangent spaces, are all this mesh.
  bool is_delaunay = false;
};

// The certificate, computed from the finished complex; nothing in it is assumed. Ask `certified`
// first; if it is false, `verdict` says what is wrong and what to do, and `violations` where. All
// other fields are measurements, set as far as the checks came.
struct Certificate {
  bool certified = false;             // every claim below holds, and the run converged
  std::string verdict;                // plain words; the first thing wrong if not certified
  std::vector<std::string> warnings;  // plain words; may be non-empty on a certified mesh

  bool closed = false;  // each (k-1)-face is in exactly two simplices
  std::uint64_t bad_faces = 0;
  bool links_are_spheres = false;      // each vertex link is a (k-1)-sphere
  bool links_decided_exactly = false;  // k <= 3, or a closed mesh whose stars embed; k = 4 also
                                       // where the links' fundamental groups and homology do
  std::uint64_t bad_links = 0;
  std::uint64_t inconsistent_simplices = 0;  // in a star but not in all its vertices' stars
  std::uint64_t unembedded_stars =
      0;                             // stars whose projection on the tangent space overlaps itself
  std::uint64_t fibre_failures = 0;  // sampled normal flats that do not meet the mesh once nearby
  std::uint64_t fibre_samples = 0;

  std::uint64_t answers_checked = 0;  // answers of the whole run, besides vertices, that were
                                      // compared with the mesh

  double max_circumradius = 0;           // max R_p(sigma), length
  double max_radius_edge = 0;            // max rho, no unit
  double min_fatness = 0;                // min Theta of the k-simplices, no unit
  double min_angle_degrees = 0;          // k = 2: smallest triangle angle; else 0
  double max_tangent_angle_degrees = 0;  // largest angle of a simplex to its vertices' tangents
  double max_barycentre_distance = 0;    // to M, length
  double estimated_reach = 0;            // length; an estimate from above
  double epsilon_over_reach = 0;  // graded sizes: the largest R_p over the local feature size

  // If the client declared a reach (Specification::declared_reach), else 0.
  CertificateLevel level = CertificateLevel::kRefused;
  double declared_reach = 0;   // length
  bool reach_refuted = false;  // points of M contradict it: the verdict names them
  double proved_distance = 0;  // kProved: no point of the mesh or of the components of M that it
                               // meets is farther from the other; a length

  std::uint64_t components = 0;
  std::int64_t euler_characteristic = 0;
  bool orientable = false;

  // For manifolds with boundary, `closed` means that each (k-1)-face is in two simplices, or in one
  // and in the boundary; links are spheres inside and balls at the boundary.
  std::uint64_t boundary_simplices = 0;  // of dimension k - 1
  std::uint64_t boundary_components = 0;
  std::int64_t boundary_euler_characteristic = 0;
  std::vector<FaceReport> faces;      // all faces, by dimension, the lowest first
  std::vector<RegionReport> regions;  // of an arrangement of walls, by label; else none
  // Of an arrangement: the vertices at which M, or a region, touches itself in an edge or a point.
  std::uint64_t pinched_vertices = 0;
  // Of all simplices, length^k, or of a boundary alone what it encloses; 0: see RegionReport. The
  // regions add up to it.
  double volume = 0;
  // The smallest angle of walls at all vertices on several walls; none: no walls meet. Set for
  // every ending of a run.
  std::optional<WallAngle> sharpest;

  bool only_too_coarse = false;  // refused for its size alone: nothing contradicts the mesh, but it
                                 // is too coarse, for the reach, to be certified

  Violations violations;
  std::optional<ProtectionReport> protection;  // if it was asked for, and the mesh is a complex
  // Over Z/2, from dimension 0 on, of a closed manifold (ClosedBettiNumbers); empty: not computed.
  std::vector<std::int64_t> betti;
};

// How a run ended, and what is known of its mesh.
//
//   if (!report.failure.ok()) std::cerr << report.failure.message << '\n';
//   if (!report.certificate.certified) std::cerr << report.certificate.verdict << '\n';
struct Report {
  Termination termination = Termination::kRunning;
  Status failure;  // the reason when termination is kOracleFailed
  Counts counts;
  Certificate certificate;
  std::optional<ReconstructionCounts> reconstruction;  // of a reconstruction alone
};

}  // namespace stellate::core
