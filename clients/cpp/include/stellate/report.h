#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stellate/error.h"

namespace stellate {

// How a run ended. Every ending but kConverged leaves a mesh that is not certified.
enum class Termination {
  kUnknown = 0,
  kConverged,     // no refinement rule applies any more
  kVertexBudget,  // MeshOptions::max_vertices is spent
  kRoundBudget,   // MeshOptions::max_rounds is spent
  kCancelled,
  kOracleFailed,
  kNoProgress,  // rules still apply, but refinement no longer helps
};
const char* TerminationName(Termination termination);  // "CONVERGED", ...

enum class Phase { kUnknown = 0, kSeeding, kRefining, kCertifying, kDone };
const char* PhaseName(Phase phase);  // "SEEDING", ...

// The progress of a mesh.
struct Progress {
  Phase phase = Phase::kUnknown;
  std::uint64_t round = 0;    // batches of queries answered
  std::uint64_t queries = 0;  // queries answered
  std::uint64_t vertices = 0, simplices = 0;
  std::uint64_t unbounded_stars = 0;  // stars on the advancing front
  // Stars with a simplex that breaks rule R1, R2, R3, R4, R5.
  std::uint64_t bad_size = 0, bad_radius_edge = 0, bad_sliver = 0, bad_inconsistent = 0;
  std::uint64_t bad_protection = 0;
  double fraction = 0;           // estimated share of the work done, 0..1
  double elapsed_seconds = 0;    // since the mesh was created, while a server had it
  double remaining_seconds = 0;  // an estimate; 0 when unknown
};

// The cost of a mesh.
struct Counts {
  std::uint64_t vertices = 0, simplices = 0;
  std::uint64_t rounds = 0;  // round trips
  std::uint64_t queries = 0;
  std::uint64_t tangent_queries = 0;  // closest points spent on finding tangent bases
  std::uint64_t inserted_size = 0;    // sample points that rule R1 inserted, then R2, R3, R4, R5
  std::uint64_t inserted_radius_edge = 0, inserted_sliver = 0, inserted_inconsistent = 0;
  std::uint64_t inserted_protection = 0;
  std::uint64_t duplicates = 0;  // answers that fell on an existing sample point
};

// How far a certificate goes.
enum class CertificateLevel {
  kUnknown,  // the server has no levels
  kRefused,
  kSampled,  // every check passed; some look at samples of the manifold
  kProved,   // and if its reach is as declared, the mesh is isotopic to the components it meets
  kDecided,  // of reconstructions, below kSampled: a manifold, but the points say too little for
             // more, and it is not certified
};
const char* CertificateLevelName(CertificateLevel level);  // "PROVED", ...

// Where a mesh is wrong: vertex ids, ascending, of the first 100 of each kind that the
// certificate counts.
struct Violations {
  // (k-1)-faces that are not in exactly two simplices, k ids each. With a boundary, the number of
  // vertices is the id of a point beyond it.
  std::vector<std::vector<std::uint32_t>> faces;
  std::vector<std::uint32_t> links;         // whose link is no sphere
  std::vector<std::uint32_t> stars;         // whose star overlaps itself
  std::vector<std::uint32_t> inconsistent;  // whose star has a simplex that is not in all stars
  std::vector<std::uint32_t> fibres;        // near which a normal flat fails
};

// A face of a manifold with boundary: where some of its walls are 0.
struct FaceCertificate {
  std::vector<std::uint32_t> walls;  // ascending
  std::uint32_t dimension = 0;       // k - 1 of the boundary, less of edges, 0 of corners
  std::uint64_t simplices = 0;
  std::uint64_t components = 0;
  std::int64_t euler_characteristic = 0;
  // Of a wall of an arrangement: the labels where it is negative and where it is positive.
  std::optional<std::uint32_t> label_below, label_above;
  double volume = 0;                // length^dimension: an area, a length; of corners their number
  std::vector<std::int64_t> betti;  // over Z/2, from dimension 0 on; empty: not computed
};

// A region of an arrangement of walls: the part of the mesh with one label. Of the boundary alone
// the region's surface, except the volume.
struct RegionCertificate {
  std::uint32_t label = 0;
  std::uint64_t simplices = 0;
  std::uint64_t components = 0;
  std::int64_t euler_characteristic = 0;
  double volume = 0;                // 0 of the boundary alone of what does not fill space
  double min_dihedral_degrees = 0;  // the least angle between two facets of a simplex
  std::vector<std::int64_t> betti;  // over Z/2, from dimension 0 on; empty: not computed
};

// Two walls that meet.
struct WallAngle {
  std::vector<std::uint32_t> walls;  // ascending
  double degrees = 0;                // between them, inside the manifold
  std::vector<double> point;         // a vertex
};

// How well a mesh is protected, in lengths. The gap of a simplex is how much farther than its
// circumradius the nearest other vertex is from its centre.
struct Protection {
  double asked = 0;
  double least = 0;                  // gap; below 0: a ball is not empty
  double percentile = 0;             // the gap that 99 % of the simplices have or exceed
  double median = 0;                 // gap
  double least_ratio = 0;            // least gap over circumradius
  std::uint64_t weak = 0;            // simplices with a smaller gap than was asked for
  std::vector<std::uint32_t> worst;  // the simplex with the least gap
  double stability_radius = 0;       // vertices that each move by less change no simplex
  double thickness_bound = 0;        // heights are at least this share of k times the longest edge
  // If the reach is as declared: the intrinsic and the restricted Delaunay complex of the vertices,
  // and their stars in tangent spaces, are all this mesh.
  bool is_delaunay = false;
};

// What the server computed from the finished complex. Lengths are in the coordinates' unit.
struct Certificate {
  bool certified = false;  // every claim holds and the run converged
  std::string verdict;     // plain words; the first thing wrong if not certified
  std::vector<std::string> warnings;

  bool closed = false;  // each (k-1)-face is in exactly two simplices
  std::uint64_t bad_faces = 0;
  bool links_are_spheres = false;
  bool links_decided_exactly = false;  // k <= 3, or a closed mesh whose stars embed
  std::uint64_t bad_links = 0;
  std::uint64_t inconsistent_simplices = 0;
  std::uint64_t unembedded_stars =
      0;                             // stars whose projection on the tangent space overlaps itself
  std::uint64_t fibre_failures = 0;  // sampled normal flats that do not meet the mesh once nearby
  std::uint64_t fibre_samples = 0;

  double max_circumradius = 0;
  double max_radius_edge = 0;
  double min_fatness = 0;        // volume / diameter^k
  double min_angle_degrees = 0;  // k = 2 only
  double max_tangent_angle_degrees = 0;
  double max_barycentre_distance = 0;  // of a simplex to the manifold
  double estimated_reach = 0;          // an estimate from above
  double epsilon_over_reach = 0;

  std::uint64_t components = 0;
  std::int64_t euler_characteristic = 0;
  bool orientable = false;

  CertificateLevel level = CertificateLevel::kUnknown;
  double declared_reach = 0;   // MeshOptions::reach; 0: none
  bool reach_refuted = false;  // points of the manifold contradict it; the verdict names them
  double proved_distance = 0;  // kProved: a bound of the Hausdorff distance to these components

  // Answers of the whole run, besides vertices, that were compared with the mesh.
  std::uint64_t answers_checked = 0;
  Violations violations;

  // Of manifolds with boundary:
  std::uint64_t boundary_simplices = 0;  // of dimension k - 1
  std::uint64_t boundary_components = 0;
  std::int64_t boundary_euler_characteristic = 0;
  std::vector<FaceCertificate> faces;      // by dimension, the lowest first
  std::optional<WallAngle> sharpest;       // where walls meet at the smallest angle, if any meet
  std::vector<RegionCertificate> regions;  // of an arrangement of walls, by label
  std::uint64_t pinched_vertices = 0;      // where a region touches itself in an edge or a point
  // Of all simplices, to which regions add up; of the boundary alone what it encloses.
  double volume = 0;

  // Refused for epsilon alone: no check contradicts the mesh, which is too coarse, compared with
  // the reach, to be certified.
  bool only_too_coarse = false;

  std::optional<Protection> protection;  // where MeshOptions::protection asks for it
  // Over Z/2, from dimension 0 on, of a closed manifold of dimension 3 or less with at most a
  // million simplices; else empty.
  std::vector<std::int64_t> betti;
};

// What a reconstruction found of its points. Lengths are in the coordinates' unit.
struct ReconstructionReport {
  struct Place {
    std::string name;          // "OK", "MERGED", ...
    std::uint64_t points = 0;  // that have it
    std::string advice;        // the cause and the cure; empty where nothing is to be done
  };
  std::vector<Place> places;
  double spacing = 0;          // median distance of a point to its nearest
  double noise = 0;            // median rms distance of the points to the surface fitted to them
  double noise_ratio = 0;      // the same in units of the local spacing
  bool smoothed = false;       // the complex was built on copies moved to the fitted surface
  std::uint64_t doubtful = 0;  // simplices about which stars disagreed at first
  std::uint64_t cavities = 0;  // the places that they made up
  std::uint64_t tiles = 0;     // simplices of the tilings that filled them
  std::uint64_t unfilled_vertices = 0;  // of the cavities that were left
  std::vector<double> looks;  // the share of points around which they look of dimension 1, 2, 3,
                              // 4, and more
};

struct ChosenEpsilon {
  double epsilon = 0;
  std::string reason;  // a sentence
};

struct Report {
  Termination termination = Termination::kUnknown;
  std::string failure_reason, failure_message;  // kOracleFailed only
  Counts counts;
  Certificate certificate;
  std::optional<ReconstructionReport> reconstruction;  // of a mesh of points alone
  double elapsed_seconds = 0;
  double epsilon = 0;          // of the mesh; 0: not known
  std::string epsilon_reason;  // why it was chosen; empty if it was given
  // With which epsilon to mesh again, where this one was too coarse for a certificate: what kAuto
  // goes on with. ToJson leaves it out.
  std::optional<ChosenEpsilon> finer;
  // All of it in several lines, for people, each with its '\n': the server's words, and why epsilon
  // was chosen. ToJson leaves it out.
  std::string text;

  bool certified() const { return certificate.certified; }
};

// One object in one line, keys as in the protocol; null for infinite, NaN and unknown.
std::string ToJson(const Report& report);
// ToJson into a file. kFileFailed when it cannot be written.
Expected<void> SaveJson(const Report& report, const std::string& path);

}  // namespace stellate
