// FilledMesh by itself; filled_mesh_test goes through whole runs.

#include <gtest/gtest.h>

#include <algorithm>

#include "core/base/basis_layout.h"
#include "core/refinement/engine.h"
#include "tests/core/support/in_process_run.h"
#include "tests/core/support/unit_sphere.h"

namespace stellate::core {
namespace {

using testing::AsSet;
using Set = std::set<Stars<4>::Simplex>;

AnsweredPoints ClosestTo(Manifold& manifold, const Eigen::MatrixXd& x) {
  AnsweredPoints answers;
  answers.points = manifold.ClosestPoint(x).points;
  const Eigen::MatrixXd bases = manifold.TangentBasis(answers.points);
  answers.tangents.resize(bases.rows(), bases.cols());
  for (Eigen::Index i = 0; i < bases.cols(); ++i)
    ToByVector(bases.col(i).data(), manifold.ambient_dimension(), 4,
               answers.tangents.col(i).data());
  answers.found.assign(static_cast<std::size_t>(x.cols()), 1);
  answers.answered = answers.found;
  return answers;
}

// A 4-dimensional mesh whose stars are left to disagree, or nothing if they happen to agree.
std::optional<Engine<4>> Disagreeing(Manifold& manifold, std::uint64_t seed) {
  Specification spec = testing::SpecificationFor(manifold, 0.5);
  spec.random_seed = seed;
  spec.oracle.intersect_flat = false;
  Engine<4> engine(spec, Resolve(spec));
  const AnsweredPoints seeds = ClosestTo(manifold, testing::RandomPointsOn(manifold, 40, seed));
  for (Eigen::Index c = 0; c < seeds.points.cols(); ++c) engine.Append(seeds, c);
  engine.Commit();
  for (std::uint64_t round = 1;; ++round) {
    const auto targets = engine.Plan();
    if (!targets || targets->empty()) break;
    const CandidateSet<4> candidates = engine.Draw(engine.Select(*targets), round);
    engine.Insert(candidates, ClosestTo(manifold, candidates.points));
    engine.Commit();
  }
  if (!engine.AllRulesHold() || engine.filled().resolved().empty()) return std::nullopt;
  return engine;
}

TEST(FilledMesh, TellsWhatItChangesWhenItIsHandedOut) {
  const auto manifold = testing::Make("ellipsoid:1:0.9:0.85:0.8:0.76");
  bool changed = false;  // what disagreed may be filled as lowest vertices have it
  for (std::uint64_t seed = 1; seed <= 12 && !changed; ++seed) {
    auto engine = Disagreeing(*manifold, seed);
    if (!engine) continue;
    const Set before = AsSet<4>(engine->Simplices());
    EXPECT_FALSE(engine->filled().is_handed_out());
    std::vector<std::uint32_t> added, removed;
    engine->filled().HandOut(engine->stars(), &added, &removed);
    EXPECT_TRUE(engine->filled().is_handed_out());
    const Set after = AsSet<4>(engine->Simplices());
    changed = after != before;
    EXPECT_EQ(engine->simplex_count(), after.size());
    Set replayed = before;
    for (const auto& s : AsSet<4>(removed)) EXPECT_EQ(replayed.erase(s), 1u);
    for (const auto& s : AsSet<4>(added)) EXPECT_TRUE(replayed.insert(s).second);
    EXPECT_EQ(replayed, after);
  }
  EXPECT_TRUE(changed);
}

TEST(FilledMesh, IsOnlyMadeForHighDimensions) {
  const Engine<2> engine = testing::EngineOnSphere(testing::SphereSpec(0.5), testing::Octahedron());
  FilledMesh<2> filled;
  filled.Fill(engine.stars(), engine.criteria());
  EXPECT_EQ(filled.cavities().cavities, 0u);
  Violation<2> violation;
  violation.rule = Rule::kInconsistent;
  EXPECT_FALSE(filled.Resolves(engine.stars(), 0, violation));
}

}  // namespace
}  // namespace stellate::core
