#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <ostream>
#include <string>
#include <vector>

#include "tests/core/support/in_process_run.h"

namespace stellate::core::testing {

// A run that is recorded: a specification, whatever answers it, and what happens on the way.
struct GoldenCase {
  const char* name;  // of its file
  const char* what;  // its first line
  std::string manifold;
  double epsilon = 0;
  std::function<void(Specification&)> change = [](Specification&) {};
  // What is done to the answers to a round, before they are given.
  std::function<void(const Specification&, const QueryBatch&, Answers&)> spoil = {};
  bool answered_by_library = false;  // by the C library's functions, which round as they like
  std::uint64_t cancel_before = 0, fail_before = 0, interrupt_before = 0;  // rounds; 0: never
};

// In place of its bytes, in the tests' names.
inline void PrintTo(const GoldenCase& c, std::ostream* out) { *out << c.name; }

namespace golden {

inline void ClosestPointsAlone(Specification& spec) { spec.oracle = {}; }

// The plane z = 0.1, which no box holds.
inline void AnswerWithAPlane(const Specification&, const QueryBatch& batch, Answers& answers) {
  for (std::size_t b = 0; b < batch.blocks.size(); ++b) {
    answers.blocks[b].found.clear();
    answers.blocks[b].points = batch.blocks[b].points;
    answers.blocks[b].points.row(2).setConstant(0.1);
  }
}

// Finer to the one side: a length for each point.
inline void GiveSizes(const Specification&, const QueryBatch& batch, Answers& answers) {
  for (std::size_t b = 0; b < batch.blocks.size(); ++b)
    if (batch.blocks[b].want_sizes)
      answers.blocks[b].sizes = 0.8 + 0.4 * answers.blocks[b].points.row(0).array().max(-1).min(1);
}

inline void NothingIsFound(const Specification&, const QueryBatch&, Answers& answers) {
  for (AnswerBlock& block : answers.blocks)
    block.found.assign(static_cast<std::size_t>(block.points.cols()), 0);
}

// Every seventh flat does not meet the manifold, as far as the oracle knows.
inline void MissSomeFlats(const Specification&, const QueryBatch& batch, Answers& answers) {
  for (std::size_t b = 0; b < batch.blocks.size(); ++b) {
    if (batch.blocks[b].kind != QueryKind::kIntersectFlat) continue;
    AnswerBlock& block = answers.blocks[b];
    block.found.resize(static_cast<std::size_t>(block.points.cols()), 1);
    for (std::size_t i = 0; i < block.found.size(); i += 7) block.found[i] = 0;
  }
}

inline void MoveTheSecondRound(const Specification& spec, const QueryBatch& batch,
                               Answers& answers) {
  if (batch.round != 2) return;
  for (AnswerBlock& block : answers.blocks) block.points.array() += 0.1 * spec.epsilon;
}

inline void GrowTheSecondRound(const Specification&, const QueryBatch& batch, Answers& answers) {
  for (AnswerBlock& block : answers.blocks)
    if (batch.round == 2) block.sizes *= 1.5;
}

inline void FindOneHalf(const Specification&, const QueryBatch&, Answers& answers) {
  for (AnswerBlock& block : answers.blocks) {
    block.found.resize(static_cast<std::size_t>(block.points.cols()));
    for (std::size_t i = 0; i < block.found.size(); ++i)
      block.found[i] = block.points(0, static_cast<Eigen::Index>(i)) < 1.1;
  }
}

// Pushed out and in by waves that no mesh of this size can follow: rules never hold.
inline void Jitter(const Specification& spec, const QueryBatch& batch, Answers& answers) {
  for (std::size_t b = 0; b < batch.blocks.size(); ++b)
    for (Eigen::Index i = 0; i < batch.blocks[b].size(); ++i) {
      const Eigen::VectorXd x = answers.blocks[b].points.col(i);
      const double wave = std::sin(60 * x.sum() / spec.epsilon);
      answers.blocks[b].points.col(i) += 0.2 * spec.epsilon * wave * x.normalized();
    }
}

inline std::vector<GoldenCase> Cases() {
  using S = Specification;
  return {
      // Oracles and dimensions.
      {"circle", "A circle in R^10, flats and tangents given", "circle:10", 0.1},
      {"knot_poor",
       "A knot, closest points alone",
       "torus-knot:2:3",
       0.1,
       ClosestPointsAlone,
       {},
       true},
      {"torus", "A torus, flats and tangents given", "torus", 0.25},
      {"torus_poor", "A torus, closest points alone", "torus", 0.3, ClosestPointsAlone},
      {"rp2_alternating", "A projective plane, tangents given, flats approached in three steps",
       "rp2", 0.4,
       [](S& s) {
         s.oracle.intersect_flat = false;
         s.criteria.flat_alternations = 3;
       }},
      {"sphere_misses_flats", "A sphere whose oracle misses some flats, no tangents given",
       "sphere:2:5", 0.3, [](S& s) { s.oracle.tangent_basis = false; }, MissSomeFlats},
      {"so3", "Rotations, flats and tangents given", "so3", 0.8},
      {"flat_torus_3_poor", "A flat 3-torus, closest points alone", "flat-torus:3", 0.8,
       ClosestPointsAlone},
      {"sphere_3_flats", "A 3-sphere judged in flats, slivers allowed", "sphere:3", 0.5,
       [](S& s) {
         s.criteria.centre_rule = CentreRule::kTangentSpace;
         s.criteria.sliver_bound = 0;
       }},
      {"ellipsoid_4", "A 4-dimensional ellipsoid whose cavities are filled",
       "ellipsoid:1:0.9:0.85:0.8:0.76", 0.55, [](S& s) { s.random_seed = 1; }},

      // Batches.
      {"torus_parts", "A torus in parts of 50 queries, tangents found", "torus", 0.3,
       [](S& s) {
         s.oracle.tangent_basis = false;
         s.limits.max_batch_queries = 50;
       }},
      {"torus_speculative", "A torus, speculative", "torus", 0.15,
       [](S& s) { s.criteria.speculative = true; }},
      {"torus_speculative_poor",
       "A torus, speculative, closest points alone, in parts of 700 queries", "torus", 0.2,
       [](S& s) {
         s.oracle = {};
         s.criteria.speculative = true;
         s.limits.max_batch_queries = 700;
       }},
      {"so3_speculative", "Rotations, speculative", "so3", 0.8,
       [](S& s) { s.criteria.speculative = true; }},

      // Sizes.
      {"ellipsoid_estimated", "An ellipsoid, sizes estimated", "ellipsoid:1:0.6:0.4", 0.3,
       [](S& s) { s.criteria.size_rate = 0.4; }},
      {"ellipsoid_deviation", "An ellipsoid, its deviation bounded", "ellipsoid:1:0.6:0.4", 0.3,
       [](S& s) { s.criteria.max_deviation = 0.02; }},
      {"torus_given", "A torus, sizes given", "torus", 0.3,
       [](S& s) {
         s.oracle.local_size = true;
         s.criteria.size_rate = 0.25;
       },
       GiveSizes},
      {"torus_given_speculative", "A torus, sizes given, speculative, tangents found", "torus", 0.3,
       [](S& s) {
         s.oracle.local_size = true;
         s.oracle.tangent_basis = false;
         s.criteria.size_rate = 0.3;
         s.criteria.speculative = true;
       },
       GiveSizes},

      // Ways to end.
      {"reach_proved", "A sphere, proved from its reach", "sphere:2", 0.3,
       [](S& s) { s.declared_reach = 1; }},
      {"reach_refuted", "A torus that contradicts the declared reach", "torus", 0.2,
       [](S& s) { s.declared_reach = 1.5; }},
      {"cover_box", "Two spheres found by covering the box", "two-spheres", 0.3,
       [](S& s) {
         s.seeds.resize(0, 0);
         s.declared_reach = 0.5;
         s.cover_box = true;
       }},
      {"components_missing", "Two spheres declared as three components", "two-spheres", 0.4,
       [](S& s) { s.components = 3; }},
      {"component_found_late", "Two spheres from a seed on one, audited thoroughly", "two-spheres",
       0.3,
       [](S& s) {
         s.seeds = Eigen::Vector3d(-3, 0, 0);
         s.audit = Audit::kThorough;
       }},
      {"vertex_budget", "A torus, at most 150 vertices", "torus", 0.2,
       [](S& s) { s.limits.max_vertices = 150; }},
      {"round_budget", "A torus, at most 9 rounds", "torus", 0.2,
       [](S& s) { s.limits.max_rounds = 9; }},
      {"cancelled", "A torus, cancelled after 6 rounds", "torus", 0.2, [](S&) {}, {}, false, 7},
      {"oracle_failed",
       "A torus whose oracle fails after 6 rounds",
       "torus",
       0.2,
       [](S&) {},
       {},
       false,
       0,
       7},
      {"no_seeds", "Nothing is found", "torus", 0.2, ClosestPointsAlone, NothingIsFound},
      {"interrupted",
       "A torus, interrupted in round 6",
       "torus",
       0.2,
       [](S&) {},
       {},
       false,
       0,
       0,
       6},
      {"not_idempotent", "Answers that do not stay where they were, refused, then put right",
       "sphere:2", 0.4, [](S& s) { s.oracle.intersect_flat = false; }, MoveTheSecondRound},
      {"sizes_change", "Sizes that are told otherwise when asked again, refused, then put right",
       "sphere:2", 0.4,
       [](S& s) {
         s.oracle.local_size = true;
         s.criteria.size_rate = 0.3;
       },
       GrowTheSecondRound},
      {"leaves_box", "A plane that leaves its box", "torus", 0.3, ClosestPointsAlone,
       AnswerWithAPlane},
      {"half_unfound", "A torus of which one half is never found, speculative", "torus", 0.3,
       [](S& s) {
         s.oracle.intersect_flat = false;
         s.criteria.speculative = true;
       },
       FindOneHalf},
      {"noise", "A sphere with waves shorter than epsilon, at most 100 rounds", "sphere:2", 0.3,
       [](S& s) {
         s.oracle = {};
         s.limits.max_rounds = 100;
       },
       Jitter, true},
      {"stalls", "A circle with waves shorter than epsilon", "circle:3", 0.3,
       [](S& s) { s.oracle = {}; }, Jitter, true},
      {"grows", "A 3-sphere, fatter tetrahedra asked for than there are", "sphere:3", 0.9,
       [](S& s) {
         s.criteria.sliver_bound = 0.3;
         s.criteria.candidates = 2;
       }},
  };
}

}  // namespace golden
}  // namespace stellate::core::testing
