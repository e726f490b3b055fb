#include "mesh_settings.h"

#include <algorithm>

namespace stellate::cli {
namespace {

using O = MeshOptions;

constexpr MeshSetting kRun[] = {
    {"--seed", "random_seed", &O::random_seed, "seed of everything random"},
    {"--worker-wait", "worker_wait_seconds", &O::worker_wait,
     "seconds that the mesh waits for a worker"},
    {"--answer", "answer_seconds", &O::answer_time,
     "that a worker may be silent over a chunk of queries"},
    {"--busy", "busy_seconds", &O::busy_time, "that a worker may take for one in all"},
    {"--max-vertices", "max_vertices", &O::max_vertices, "stop there"},
    {"--max-rounds", "max_rounds", &O::max_rounds, "stop after this many round trips"},
    {"--max-batch-queries", "max_batch_queries", &O::max_batch_queries,
     "ask larger rounds in several batches"},
    {"--box-seeds", "box_seeds", &O::box_seeds, "points of the box tried as seeds"},
    {"--components", "components", &O::components,
     "that the manifold has at least: fewer are not certified"},
    {"--reach", "declared_reach", &O::reach,
     "declare a lower bound of the reach, to have the mesh proved"},
    {"--boundary-only", "boundary_only", &O::boundary_only,
     "mesh the boundary of a solid alone, without the inside: simplices of one dimension less"},
    {"--cover-box", "cover_box", &O::cover_box,
     "miss no component in the bounding box; needs --reach"},
};

constexpr MeshSetting kServing[] = {
    {"--workers", "workers", &O::workers, "threads that answer the server"},
    {"--max-chunk", "max_chunk", &O::max_chunk, "most points in one call of the oracle"},
};

constexpr MeshSetting kCriteria[] = {
    {"--radius-edge", "radius_edge_bound", &O::radius_edge_bound, "rho0 of rule R2"},
    {"--sliver", "sliver_bound", &O::sliver_bound, "Theta0 of rule R3, 0: off"},
    {"--picking-radius", "picking_radius", &O::picking_radius, "delta of the picking region"},
    {"--small-sliver-radius", "small_sliver_radius", &O::small_sliver_radius,
     "beta: which slivers count against a candidate"},
    {"--candidates", "candidates", &O::candidates, "tried in a picking region"},
    {"--advance-step", "advance_step", &O::advance_step, "h: the front's step, a length"},
    {"--flat-alternations", "flat_alternations", &O::flat_alternations,
     "closest points towards a flat, without intersections"},
    {"--speculative,!--no-speculative", "speculative", &O::speculative,
     "refine a surrogate first: fewer round trips, more processor time"},
    {"--size-rate", "size_rate", &O::size_rate,
     "R_p at most this share of the local size: the manifold's own where it is known, or "
     "estimated"},
    {"--max-deviation", "max_deviation", &O::max_deviation,
     "circumcentres at most so far from the manifold, a length"},
    {"--protection", "protection", &O::protection,
     "rule R5: other vertices stay off each simplex's ball by this share of epsilon, at most 0.1"},
    {"--common-centre,!--no-common-centre", "common_centre", &O::common_centre,
     "judge a simplex at one centre for all its vertices"},
};

// The flag that sets a field, or the word as it is. Words of English name fields only where a
// message begins with them.
std::string_view FlagOf(std::string_view word, bool is_first) {
  std::string_view name = word;
  for (const std::string_view group : {"criteria.", "limits."}) {
    if (name.starts_with(group)) name.remove_prefix(group.size());
  }
  if (name == word && !is_first && name.find('_') == name.npos) return word;
  if (name == "good_shape") return "--shape";
  for (const auto settings : {RunSettings(), ServingSettings(), CriteriaSettings()}) {
    for (const MeshSetting& setting : settings) {
      const std::string_view flag = setting.flag;
      if (name == setting.name) return flag.substr(0, flag.find(','));
    }
  }
  return word;
}

}  // namespace

std::string InFlags(std::string_view message) {
  constexpr std::string_view kLetters = "abcdefghijklmnopqrstuvwxyz_.";
  std::string said;
  for (std::size_t at = 0; at < message.size();) {
    const std::size_t end = std::min(message.find_first_not_of(kLetters, at), message.size());
    if (end == at) {
      said += message[at++];
      continue;
    }
    std::string_view word = message.substr(at, end - at);
    const std::string_view stop = word.ends_with('.') ? "." : "";
    word.remove_suffix(stop.size());
    said.append(FlagOf(word, at == 0)).append(stop);
    at = end;
  }
  return said;
}

std::span<const MeshSetting> RunSettings() { return kRun; }
std::span<const MeshSetting> ServingSettings() { return kServing; }
std::span<const MeshSetting> CriteriaSettings() { return kCriteria; }

}  // namespace stellate::cli
