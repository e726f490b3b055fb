#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/mesher.h"
#include "tests/core/support/samples.h"
#include "tests/support/run_mesher.h"

namespace stellate::core::testing {

using stellate::testing::AnswersOf;
using stellate::testing::SpecificationFor;

using Answerer = std::function<Answers(const QueryBatch&)>;

inline Answerer AnswererFor(Oracle& oracle) {
  return [&oracle](const QueryBatch& batch) { return AnswersOf(oracle, batch); };
}

// A mesher driven to its end in this process, and all it said on the way.
struct DrivenRun {
  std::unique_ptr<Mesher> mesher;
  std::vector<MeshDelta> deltas;

  const Report& report() const { return mesher->report(); }
};

inline std::unique_ptr<Mesher> NewMesher(const Specification& spec, Execution execution = {}) {
  auto mesher = Mesher::Create(spec, execution);
  if (!mesher) throw std::runtime_error(mesher.error().message);
  return std::move(*mesher);
}

inline MeshDelta Step(Mesher& mesher, const Answerer& answer) {
  auto delta = mesher.Absorb(answer(*mesher.NextBatch()));
  if (!delta) throw std::runtime_error(delta.error().message);
  return std::move(*delta);
}

inline DrivenRun Drive(const Specification& spec, const Answerer& answer,
                       Execution execution = {}) {
  DrivenRun run{NewMesher(spec, execution), {}};
  while (run.mesher->NextBatch()) run.deltas.push_back(Step(*run.mesher, answer));
  return run;
}

inline DrivenRun Drive(const Specification& spec, Oracle& oracle, Execution execution = {}) {
  return Drive(spec, AnswererFor(oracle), execution);
}

// Bit for bit: points, tangents, simplices, and how the run went.
inline ::testing::AssertionResult SameMesh(const Mesher& a, const Mesher& b) {
  const auto same_bits = [](const Eigen::MatrixXd& x, const Eigen::MatrixXd& y) {
    return x.rows() == y.rows() && x.cols() == y.cols() &&
           std::equal(x.data(), x.data() + x.size(), y.data());
  };
  if (!same_bits(a.Points(), b.Points())) return ::testing::AssertionFailure() << "points differ";
  if (!same_bits(a.Tangents(), b.Tangents()))
    return ::testing::AssertionFailure() << "tangents differ";
  if (a.Simplices() != b.Simplices()) return ::testing::AssertionFailure() << "simplices differ";
  const Counts &x = a.report().counts, &y = b.report().counts;
  if (a.report().termination != b.report().termination || x.rounds != y.rounds ||
      x.queries != y.queries || x.tangent_queries != y.tangent_queries ||
      x.inserted_size != y.inserted_size || x.inserted_radius_edge != y.inserted_radius_edge ||
      x.inserted_sliver != y.inserted_sliver ||
      x.inserted_inconsistent != y.inserted_inconsistent ||
      x.inserted_protection != y.inserted_protection || x.duplicates != y.duplicates)
    return ::testing::AssertionFailure() << "the runs differ";
  return ::testing::AssertionSuccess();
}

// What can be counted from the list of simplices alone.
struct Topology {
  bool closed = true;  // each (k-1)-face in exactly two simplices
  std::int64_t euler_characteristic = 0;
  std::uint64_t components = 0;
  std::uint64_t used_vertices = 0;
};

inline Topology TopologyOf(const std::vector<std::uint32_t>& simplices, int k) {
  std::map<std::vector<std::uint32_t>, int> faces;  // of all dimensions, with multiplicity
  std::map<std::uint32_t, std::uint32_t> parent;
  const auto root = [&](std::uint32_t v) {
    while (parent.at(v) != v) v = parent[v] = parent.at(parent.at(v));
    return v;
  };
  const auto stride = static_cast<std::size_t>(k) + 1;
  for (std::size_t i = 0; i < simplices.size(); i += stride) {
    for (unsigned subset = 1; subset < (1u << stride); ++subset) {
      std::vector<std::uint32_t> face;
      for (std::size_t s = 0; s < stride; ++s)
        if (subset >> s & 1) face.push_back(simplices[i + s]);
      ++faces[face];
    }
    for (std::size_t s = 0; s < stride; ++s) parent.try_emplace(simplices[i + s], simplices[i + s]);
    for (std::size_t s = 1; s < stride; ++s) parent[root(simplices[i + s])] = root(simplices[i]);
  }
  Topology topology;
  for (const auto& [face, count] : faces) {
    topology.euler_characteristic += face.size() % 2 ? 1 : -1;
    if (face.size() == stride - 1) topology.closed = topology.closed && count == 2;
  }
  topology.used_vertices = parent.size();
  for (const auto& [v, p] : parent) topology.components += v == p;
  return topology;
}

// What every certified mesh of a catalogue manifold must be, by this program's own count.
inline void ExpectGoodMesh(const DrivenRun& run, const ManifoldFacts& facts) {
  const Specification& spec = run.mesher->specification();
  const Report& report = run.report();
  const Certificate& c = report.certificate;
  ASSERT_EQ(report.termination, Termination::kConverged) << report.failure.message;
  EXPECT_TRUE(c.certified) << c.verdict;
  const std::vector<std::uint32_t> simplices = run.mesher->Simplices();
  const Topology topology = TopologyOf(simplices, spec.dimension);
  EXPECT_TRUE(topology.closed);
  EXPECT_EQ(topology.euler_characteristic, facts.euler_characteristic);
  EXPECT_EQ(topology.components, static_cast<std::uint64_t>(facts.betti_mod2[0]));
  EXPECT_EQ(c.closed, topology.closed);
  EXPECT_EQ(c.euler_characteristic, topology.euler_characteristic);
  EXPECT_EQ(c.components, topology.components);
  EXPECT_EQ(c.orientable, facts.orientable);
  EXPECT_LE(c.max_circumradius, spec.epsilon * (1 + 1e-9));
  EXPECT_GT(c.max_circumradius, 0.3 * spec.epsilon);  // refined no further than asked
  EXPECT_LE(c.max_radius_edge, spec.criteria.radius_edge_bound * (1 + 1e-6));
  EXPECT_EQ(c.inconsistent_simplices, 0u);
  const auto vertices = static_cast<std::uint64_t>(run.mesher->Points().cols());
  EXPECT_EQ(report.counts.vertices, vertices);
  EXPECT_EQ(topology.used_vertices, vertices);
  EXPECT_EQ(report.counts.simplices,
            simplices.size() / (static_cast<std::size_t>(spec.dimension) + 1));
  EXPECT_EQ(report.counts.rounds, run.deltas.size());
}

}  // namespace stellate::core::testing
