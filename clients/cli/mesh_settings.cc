#include "mesh_settings.h"

namespace stellate::cli {
namespace {

using O = MeshOptions;

constexpr MeshSetting kRun[] = {
    {"--seed", &O::random_seed, "seed of everything random"},
    {"--worker-wait", &O::worker_wait, "seconds that the mesh waits for a worker"},
    {"--answer", &O::answer_time, "that a worker may be silent over a chunk of queries"},
    {"--busy", &O::busy_time, "that a worker may take for one in all"},
    {"--max-vertices", &O::max_vertices, "stop there"},
    {"--max-rounds", &O::max_rounds, "stop after this many round trips"},
    {"--max-batch-queries", &O::max_batch_queries, "ask larger rounds in several batches"},
    {"--box-seeds", &O::box_seeds, "points of the box tried as seeds"},
    {"--components", &O::components, "that the manifold has at least: fewer are not certified"},
    {"--reach", &O::reach, "declare a lower bound of the reach, to have the mesh proved"},
    {"--boundary-only", &O::boundary_only,
     "mesh the boundary of a solid alone, without the inside: simplices of one dimension less"},
    {"--cover-box", &O::cover_box, "miss no component in the bounding box; needs --reach"},
};

constexpr MeshSetting kServing[] = {
    {"--workers", &O::workers, "threads that answer the server"},
    {"--max-chunk", &O::max_chunk, "most points in one call of the oracle"},
};

constexpr MeshSetting kCriteria[] = {
    {"--radius-edge", &O::radius_edge_bound, "rho0 of rule R2"},
    {"--sliver", &O::sliver_bound, "Theta0 of rule R3, 0: off"},
    {"--picking-radius", &O::picking_radius, "delta of the picking region"},
    {"--small-sliver-radius", &O::small_sliver_radius,
     "beta: which slivers count against a candidate"},
    {"--candidates", &O::candidates, "tried in a picking region"},
    {"--advance-step", &O::advance_step, "h: the front's step, a length"},
    {"--flat-alternations", &O::flat_alternations,
     "closest points towards a flat, without intersections"},
    {"--speculative,!--no-speculative", &O::speculative,
     "refine a surrogate first: fewer round trips, more processor time"},
    {"--size-rate", &O::size_rate,
     "R_p at most this share of the local size: the manifold's own where it is known, or "
     "estimated"},
    {"--max-deviation", &O::max_deviation,
     "circumcentres at most so far from the manifold, a length"},
    {"--protection", &O::protection,
     "rule R5: other vertices stay off each simplex's ball by this share of epsilon, at most 0.1"},
    {"--common-centre,!--no-common-centre", &O::common_centre,
     "judge a simplex at one centre for all its vertices"},
};

}  // namespace

std::span<const MeshSetting> RunSettings() { return kRun; }
std::span<const MeshSetting> ServingSettings() { return kServing; }
std::span<const MeshSetting> CriteriaSettings() { return kCriteria; }

}  // namespace stellate::cli
