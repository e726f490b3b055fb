#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <ostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/core/support/arrangements.h"
#include "tests/core/support/domains.h"
#include "tests/core/support/in_process_run.h"

namespace stellate::core::testing {

// A run that is recorded: a specification, whatever answers it, and what happens on the way. Its
// file says in words what it shows.
struct GoldenCase {
  const char* name;      // of its file
  std::string manifold;  // of the built-in ones; empty: `walled`
  double epsilon = 0;
  std::function<void(Specification&)> change = [](Specification&) {};
  // What is done to the answers to a round, before they are given.
  std::function<void(const Specification&, const QueryBatch&, Answers&)> spoil = {};
  bool answered_by_library = false;  // by the C library's functions, which round as they like
  std::uint64_t cancel_before = 0, fail_before = 0, interrupt_before = 0;  // rounds; 0: never
  std::shared_ptr<const stellate::testing::Arrangement> walled = nullptr;
};

// M with walls, and with labels if it has a function of them.
inline GoldenCase Walled(
    const char* name, stellate::testing::Arrangement walled, double epsilon,
    std::function<void(Specification&)> change = [](Specification&) {}, bool by_library = false) {
  GoldenCase c{name, "", epsilon, std::move(change), {}, by_library};
  c.walled = std::make_shared<const stellate::testing::Arrangement>(std::move(walled));
  return c;
}

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
    if (batch.blocks[b].want.sizes)
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

inline stellate::testing::Arrangement Unlabelled(stellate::testing::Domain domain) {
  stellate::testing::Arrangement a;
  a.domain = std::move(domain);
  return a;
}

inline stellate::testing::Arrangement OfSpace(std::string_view name) {
  for (auto& a : stellate::testing::SpaceArrangements())
    if (a.name == name) return a;
  throw std::invalid_argument("no arrangement of space is named " + std::string(name));
}

// Boundaries, creases, materials.
inline std::vector<GoldenCase> WalledCases() {
  using S = Specification;
  namespace t = stellate::testing;
  return {
      Walled("walls_arc", Unlabelled(t::Arc()), 0.2),
      Walled("walls_octant", Unlabelled(t::Octant()), 0.3),
      Walled("walls_annulus", Unlabelled(t::Annulus()), 0.15),
      Walled("walls_hemisphere_speculative", Unlabelled(t::Hemisphere()), 0.3,
             [](S& s) { s.criteria.speculative = true; }),
      Walled("walls_vertex_budget", Unlabelled(t::Annulus()), 0.1,
             [](S& s) { s.limits.max_vertices = 60; }),
      Walled("labels_two_coloured_torus", t::PlaneArrangements().back(), 0.3),
      Walled(
          "labels_three_phases", t::PhaseArrangements().front(), 0.15, [](S&) {}, true),
      Walled("labels_cube_plus_ball", OfSpace("CubePlusBall"), 0.5),
      Walled("labels_lens_in_ball", OfSpace("LensInBall"), 0.35),
      Walled("boundary_of_union", OfSpace("Union"), 0.4, [](S& s) { s.boundary_only = true; }),
  };
}

inline std::vector<GoldenCase> Cases() {
  using S = Specification;
  return {
      // Oracles and dimensions.
      {"circle", "circle:10", 0.1},
      {"knot_poor", "torus-knot:2:3", 0.1, ClosestPointsAlone, {}, true},
      {"torus", "torus", 0.25},
      {"torus_poor", "torus", 0.3, ClosestPointsAlone},
      {"rp2_alternating", "rp2", 0.4,
       [](S& s) {
         s.oracle.intersect_flat = false;
         s.criteria.flat_alternations = 3;
       }},
      {"sphere_misses_flats", "sphere:2:5", 0.3, [](S& s) { s.oracle.tangent_basis = false; },
       MissSomeFlats},
      {"so3", "so3", 0.8},
      {"flat_torus_3_poor", "flat-torus:3", 0.8, ClosestPointsAlone},
      {"sphere_3_flats", "sphere:3", 0.5,
       [](S& s) {
         s.criteria.centre_rule = CentreRule::kTangentSpace;
         s.criteria.sliver_bound = 0;
       }},
      {"ellipsoid_4", "ellipsoid:1:0.9:0.85:0.8:0.76", 0.55, [](S& s) { s.random_seed = 1; }},

      // Batches.
      {"torus_parts", "torus", 0.3,
       [](S& s) {
         s.oracle.tangent_basis = false;
         s.limits.max_batch_queries = 50;
       }},
      {"torus_speculative", "torus", 0.15, [](S& s) { s.criteria.speculative = true; }},
      {"torus_speculative_poor", "torus", 0.2,
       [](S& s) {
         s.oracle = {};
         s.criteria.speculative = true;
         s.limits.max_batch_queries = 700;
       }},
      {"so3_speculative", "so3", 0.8, [](S& s) { s.criteria.speculative = true; }},

      // Sizes.
      {"ellipsoid_estimated", "ellipsoid:1:0.6:0.4", 0.3, [](S& s) { s.criteria.size_rate = 0.4; }},
      {"ellipsoid_deviation", "ellipsoid:1:0.6:0.4", 0.3,
       [](S& s) { s.criteria.max_deviation = 0.02; }},
      {"torus_given", "torus", 0.3,
       [](S& s) {
         s.oracle.local_size = true;
         s.criteria.size_rate = 0.25;
       },
       GiveSizes},
      {"torus_given_speculative", "torus", 0.3,
       [](S& s) {
         s.oracle.local_size = true;
         s.oracle.tangent_basis = false;
         s.criteria.size_rate = 0.3;
         s.criteria.speculative = true;
       },
       GiveSizes},

      // Ways to end.
      {"reach_proved", "sphere:2", 0.3, [](S& s) { s.declared_reach = 1; }},
      {"reach_refuted", "torus", 0.2, [](S& s) { s.declared_reach = 1.5; }},
      {"cover_box", "two-spheres", 0.3,
       [](S& s) {
         s.seeds.resize(0, 0);
         s.declared_reach = 0.5;
         s.cover_box = true;
       }},
      {"components_missing", "two-spheres", 0.4, [](S& s) { s.components = 3; }},
      {"component_found_late", "two-spheres", 0.3,
       [](S& s) {
         s.seeds = Eigen::Vector3d(-3, 0, 0);
         s.audit = Audit::kThorough;
       }},
      {"vertex_budget", "torus", 0.2, [](S& s) { s.limits.max_vertices = 150; }},
      {"round_budget", "torus", 0.2, [](S& s) { s.limits.max_rounds = 9; }},
      {"cancelled", "torus", 0.2, [](S&) {}, {}, false, 7},
      {"oracle_failed", "torus", 0.2, [](S&) {}, {}, false, 0, 7},
      {"no_seeds", "torus", 0.2, ClosestPointsAlone, NothingIsFound},
      {"interrupted", "torus", 0.2, [](S&) {}, {}, false, 0, 0, 6},
      {"not_idempotent", "sphere:2", 0.4, [](S& s) { s.oracle.intersect_flat = false; },
       MoveTheSecondRound},
      {"sizes_change", "sphere:2", 0.4,
       [](S& s) {
         s.oracle.local_size = true;
         s.criteria.size_rate = 0.3;
       },
       GrowTheSecondRound},
      {"leaves_box", "torus", 0.3, ClosestPointsAlone, AnswerWithAPlane},
      {"half_unfound", "torus", 0.3,
       [](S& s) {
         s.oracle.intersect_flat = false;
         s.criteria.speculative = true;
       },
       FindOneHalf},
      {"noise", "sphere:2", 0.3,
       [](S& s) {
         s.oracle = {};
         s.limits.max_rounds = 100;
       },
       Jitter, true},
      {"stalls", "circle:3", 0.3, [](S& s) { s.oracle = {}; }, Jitter, true},
      {"grows", "sphere:3", 0.9,
       [](S& s) {
         s.criteria.sliver_bound = 0.3;
         s.criteria.candidates = 2;
       }},
  };
}

}  // namespace golden
}  // namespace stellate::core::testing
