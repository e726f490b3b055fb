#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "stellate/connection.h"
#include "stellate/doctor.h"
#include "stellate/download.h"
#include "stellate/error.h"
#include "stellate/mesh.h"
#include "stellate/oracle.h"

namespace stellate {

// An epsilon that ChooseEpsilon chooses. If the mesh is too coarse to be certified, it is meshed
// again, twice at most, with what its certificate shows.
struct Auto {};
inline constexpr Auto kAuto;

// The largest circumradius of a simplex: a length, or kAuto.
//
//   options.epsilon = 0.1;
//   options.epsilon = stellate::kAuto;
class Epsilon {
 public:
  constexpr Epsilon(double length) : length_(length) {}  // NOLINT(*-explicit-*): see above
  constexpr Epsilon(Auto) {}                             // NOLINT(*-explicit-*)

  // Nothing: kAuto.
  constexpr const std::optional<double>& length() const { return length_; }

 private:
  std::optional<double> length_;
};

// What to mesh and how. What is absent (nullopt; an empty text, function or matrix) takes the
// server's default; see mesh.proto for each.
struct MeshOptions {
  Epsilon epsilon = 0;  // required
  // Called on the calling thread with each epsilon that kAuto chose; Report::epsilon_reason has the
  // last reason.
  std::function<void(double epsilon, const std::string& reason)> on_epsilon;

  // Without a server: a private stellated is started for this mesh and stopped after it; found by
  // $STELLATED, next to the running program, or on PATH. A server that is to be waited for while it
  // is away must record its meshes (stellated --data-dir).
  Connection connection;
  // How many threads answer, each with a stream of its own. They call the oracle in parallel.
  int workers = 1;
  // The most points in one call of the oracle. By default as many as take it a quarter of a
  // second, or four times what a call of it costs.
  std::optional<std::uint32_t> max_chunk;
  // Called on the calling thread. An exception from it cancels the mesh and reaches the caller.
  std::function<void(const Progress&)> on_progress;
  // Of MeshManifoldTo: see DownloadOptions.
  std::function<void(std::uint64_t received, std::uint64_t all)> on_part;
  // Cancels the mesh when stop is requested; the mesh so far is returned, not certified.
  std::stop_token stop;

  // Where axes have different units: about how far the manifold goes along each, d lengths above
  // zero, or one for all. What is meshed is oracles::InUnits(oracle, scale): lengths are of x /
  // scale, and the mesh and its report's places are in x.
  std::vector<double> scale;

  std::uint64_t random_seed = 1;
  std::optional<std::uint64_t> max_vertices, max_rounds;
  std::optional<std::uint64_t> max_batch_queries;  // larger rounds are sent in several batches
  std::optional<std::uint32_t> box_seeds;
  std::optional<std::uint32_t> components;  // of M, at least; a mesh with fewer is not certified
  // Query every vertex and every simplex for the certificate.
  std::optional<bool> thorough_audit;
  // A promise: the manifold's reach is at least this length. The mesh is refined until the promise
  // proves its topology, or is refuted; see docs/using/proof.md.
  std::optional<double> reach;
  // Look for every component in the bounding box, which `reach` makes finite.
  std::optional<bool> cover_box;
  // Mesh the boundary of a solid alone, and what is between regions, without the inside: the mesh
  // has simplices of one dimension less, their normals outwards.
  std::optional<bool> boundary_only;

  std::optional<double> radius_edge_bound;  // rho0 of rule R2
  std::optional<double> sliver_bound;       // Theta0 of rule R3
  // Closed, k = 3, in place of sliver_bound: 0.3, and dihedral angles of 18 degrees at least, not
  // 14, with 5 to 25 % more vertices.
  bool good_shape = false;
  std::optional<double> picking_radius;       // delta
  std::optional<double> small_sliver_radius;  // beta
  std::optional<std::uint32_t> candidates;    // tried in a picking region
  std::optional<double> advance_step;         // h, a length
  std::optional<std::uint32_t> flat_alternations;
  // Speculative sampling: a handful of round trips, and one and a half to three times the processor
  // time. Default: on, unless the server is on this machine.
  std::optional<bool> speculative;
  // R_p at most this share of the local size, (0, 1]: the oracle's if it has one, else estimated.
  std::optional<double> size_rate;
  std::optional<double> max_deviation;  // circumcentres at most so far from M, a length
  std::optional<double> protection;     // rule R5, in epsilon: at most 0.1 for k <= 2, else 0.05
  std::optional<bool> common_centre;    // test simplices at a centre common to their vertices

  std::optional<Seconds> worker_wait, answer_time, busy_time;  // limits of the workers
  std::string label;  // shown in the server's lists and logs
};

// Meshes the oracle's manifold: offers the oracle to the server and collects the mesh.
//
//   stellate::MeshOptions options;
//   options.epsilon = 0.1;
//   const auto mesh = stellate::MeshManifold(oracle, options);
//   if (!mesh) std::cerr << mesh.error().message;
//   else if (mesh->report.certified()) Use(*mesh);
//
// Returns a mesh whenever the run ends by itself, certified or not: read Mesh::report. Returns an
// error if the request is refused, the server cannot be reached, or the oracle's answers break a
// rule. An exception from the oracle reaches the caller unchanged, and the server as a failed
// oracle.
Expected<Mesh> MeshManifold(Oracle& oracle, const MeshOptions& options);

// The same into files, as DownloadMeshTo writes them once the mesh is over: it is never held here.
Expected<SavedMesh> MeshManifoldTo(Oracle& oracle, const std::vector<std::string>& paths,
                                   const MeshOptions& options);

struct ServerHealth {
  bool serving = false;
  std::string version;
  std::vector<std::string> protocols;
  std::uint32_t max_dimension = 0, max_ambient_dimension = 0, max_meshes = 0;
  std::uint64_t max_vertices = 0, max_rounds = 0, max_message_bytes = 0;
  std::uint32_t owner_meshes = 0;        // of one owner, where clients are authenticated
  std::uint64_t max_memory_bytes = 0;    // of all meshes, as the server estimates it
  std::uint64_t owner_memory_bytes = 0;  // of one owner's meshes
  std::uint32_t max_workers = 0;         // of one mesh
  std::uint32_t max_watchers = 0;        // of one mesh, downloads included
  double check_share = 0;  // of the queries, asked of two workers to compare the answers
};

// Asks a server for its health and limits. kServerFailed if none answers within `timeout`.
Expected<ServerHealth> CheckHealth(const Connection& connection, Seconds timeout = Seconds(5));

}  // namespace stellate
