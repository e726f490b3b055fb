#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "core/complex/consistency.h"
#include "core/refinement/criteria.h"
#include "tests/core/support/dihedrals.h"
#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using testing::AppendTo;
using testing::AsSet;
using testing::Drive;
using testing::DrivenRun;
using testing::ExpectGoodMesh;
using testing::FramedPoints;
using testing::Make;
using testing::RandomPointsOn;
using testing::SpecificationFor;
using testing::StarOf;

struct Case {
  std::string manifold;
  double epsilon;
  bool intersect_flat = true;
  bool tangents = true;
  int alternations = 1;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.manifold << " epsilon " << c.epsilon << (c.intersect_flat ? "" : " without flats")
       << (c.tangents ? "" : " without tangents") << " alternations " << c.alternations;
}

class Refinements : public ::testing::TestWithParam<Case> {
 protected:
  Specification Spec(Manifold& manifold) const {
    Specification spec = SpecificationFor(manifold, GetParam().epsilon);
    spec.oracle.intersect_flat = GetParam().intersect_flat;
    spec.oracle.tangent_basis = GetParam().tangents;
    spec.criteria.flat_alternations = GetParam().alternations;
    return spec;
  }
};

TEST_P(Refinements, GiveTheManifold) {
  const auto manifold = Make(GetParam().manifold);
  const DrivenRun run = Drive(Spec(*manifold), *manifold);
  ExpectGoodMesh(run, manifold->facts());
  EXPECT_LT(manifold->Distance(run.mesher->Points()).maxCoeff(), 1e-9);
  const Counts& counts = run.report().counts;
  EXPECT_EQ(counts.tangent_queries == 0, GetParam().tangents);
}

INSTANTIATE_TEST_SUITE_P(Catalogue, Refinements,
                         ::testing::Values(Case{"circle:10", 0.3}, Case{"torus-knot:2:3", 0.1},
                                           Case{"torus", 0.2}, Case{"ellipsoid", 0.25},
                                           Case{"rp2", 0.4}, Case{"clifford-torus", 0.3},
                                           Case{"two-spheres", 0.3}, Case{"torus:1:0.4@20", 0.25},
                                           Case{"so3", 0.8}, Case{"flat-torus:3", 0.6},
                                           Case{"sphere:4:5", 0.7},
                                           Case{"ellipsoid:1:0.9:0.85:0.8:0.76", 0.45}));

INSTANTIATE_TEST_SUITE_P(
    PoorerOracles, Refinements,
    ::testing::Values(Case{"circle:10", 0.3, false, false}, Case{"torus", 0.2, false, true},
                      Case{"torus", 0.2, true, false}, Case{"torus", 0.2, false, false},
                      Case{"torus", 0.2, false, true, 3},
                      Case{"clifford-torus", 0.3, false, false, 3}, Case{"rp2", 0.4, true, false},
                      Case{"so3", 0.8, false, true}, Case{"so3", 0.8, true, false},
                      Case{"flat-torus:3", 0.6, false, false},
                      Case{"flat-torus:3", 0.7, false, true, 3}));

// Rebuilds the stars from the finished points: what the run says of itself must be so.
template <int K>
void ExpectRulesHold(const DrivenRun& run, const Specification& spec) {
  const ResolvedCriteria criteria = Resolve(spec);
  FramedPoints sample;
  sample.d = spec.ambient_dimension;
  sample.k = K;
  sample.Append(run.mesher->Points(), run.mesher->Tangents());
  Stars<K> stars(sample.d, spec.epsilon, {criteria.advance_step, CentreRule::kTangentSpace});
  AppendTo(&stars, sample);
  stars.Commit();
  std::set<typename Stars<K>::Simplex> all;
  for (std::uint32_t p = 0; p < stars.size(); ++p) {
    EXPECT_FALSE(
        WorstSizeOrShape<K>(stars, p, spec.epsilon, criteria.radius_edge_bound).has_value());
    EXPECT_FALSE(
        WorstSliverOrInconsistent<K>(stars, p, criteria.shape, criteria.epsilon).has_value());
    EXPECT_EQ(CountInconsistent<K>(stars, p), 0u);
    all.merge(StarOf(stars, p));
  }
  EXPECT_EQ(all, AsSet<K>(run.mesher->Simplices()));
}

template <int K>
void ExpectRulesHoldOn(const std::string& name, double epsilon) {
  const auto manifold = Make(name);
  Specification spec = SpecificationFor(*manifold, epsilon);
  spec.criteria.centre_rule = CentreRule::kTangentSpace;
  const DrivenRun run = Drive(spec, *manifold);
  ExpectGoodMesh(run, manifold->facts());
  ExpectRulesHold<K>(run, spec);
}

TEST(Rules, HoldInTheRebuiltStars) {
  ExpectRulesHoldOn<1>("torus-knot:2:3", 0.1);
  ExpectRulesHoldOn<2>("torus", 0.15);
  ExpectRulesHoldOn<2>("rp2", 0.3);
  ExpectRulesHoldOn<3>("flat-torus:3", 0.5);
  ExpectRulesHoldOn<3>("so3", 0.6);
}

TEST(Rules, TakeStricterCriteria) {
  const auto manifold = Make("torus");
  Specification spec = SpecificationFor(*manifold, 0.25);
  spec.criteria.radius_edge_bound = 1.3;
  spec.criteria.sliver_bound = 0.2;
  spec.criteria.candidates = 5;
  const DrivenRun run = Drive(spec, *manifold);
  ExpectGoodMesh(run, manifold->facts());
  ExpectRulesHold<2>(run, spec);
}

// A chord of the circle has R_p <= epsilon when the arc is at most about 2 epsilon.
TEST(Refinement, UsesAsManyPointsAsTheSizeAsksFor) {
  const auto manifold = Make("circle:3");
  for (const double epsilon : {0.2, 0.05}) {
    const DrivenRun run = Drive(SpecificationFor(*manifold, epsilon), *manifold);
    const double fewest = std::numbers::pi / epsilon;
    EXPECT_GE(static_cast<double>(run.report().counts.vertices), fewest);
    EXPECT_LE(static_cast<double>(run.report().counts.vertices), 2.5 * fewest);
  }
}

// Seeds.

TEST(Seeds, OnARegularGridMeshAsWellAsAny) {
  const auto manifold = Make("torus");
  Specification spec = SpecificationFor(*manifold, 0.2);
  spec.bounding_box.reset();
  spec.seeds.resize(3, 9 * 9 * 3);
  for (int i = 0, c = 0; i < 9; ++i)
    for (int j = 0; j < 9; ++j)
      for (int l = 0; l < 3; ++l)
        spec.seeds.col(c++) << (i - 4) * 0.35, (j - 4) * 0.35, (l - 1) * 0.4;
  ExpectGoodMesh(Drive(spec, *manifold), manifold->facts());
}

// Every star sees the same exactly symmetric surroundings.
TEST(Seeds, OnAGridOfTheFlatTorusMeshAsWellAsAny) {
  for (const int k : {2, 3}) {
    const auto manifold = Make(k == 2 ? "clifford-torus" : "flat-torus:3");
    const FramedPoints grid = testing::TorusGrid(k, k == 2 ? 16 : 10);
    Specification spec = SpecificationFor(*manifold, k == 2 ? 0.25 : 0.6);
    spec.bounding_box.reset();
    spec.seeds = Eigen::Map<const Eigen::MatrixXd>(grid.points.data(), grid.d, grid.size());
    const double radius = manifold->ClosestPoint(spec.seeds).points.col(0).norm();
    spec.seeds *= radius / std::sqrt(k);
    const DrivenRun run = Drive(spec, *manifold);
    ExpectGoodMesh(run, manifold->facts());
  }
}

TEST(Seeds, ManyTimesTheSameAreOne) {
  const auto manifold = Make("ellipsoid");
  const Eigen::MatrixXd points = RandomPointsOn(*manifold, 7, 5);
  Specification once = SpecificationFor(*manifold, 0.3);
  once.bounding_box.reset();
  once.seeds = points;
  Specification often = once;
  often.seeds = points.replicate(1, 30);
  const DrivenRun a = Drive(once, *manifold), b = Drive(often, *manifold);
  ExpectGoodMesh(b, manifold->facts());
  EXPECT_EQ(a.mesher->Points(), b.mesher->Points());
  EXPECT_EQ(a.mesher->Simplices(), b.mesher->Simplices());
}

TEST(Seeds, OneCoversAComponent) {
  for (const char* name : {"torus", "rp2", "so3", "torus-knot:2:3"}) {
    const auto manifold = Make(name);
    const double epsilon = manifold->dimension() == 3   ? 0.8
                           : manifold->dimension() == 2 ? 0.3
                                                        : 0.1;
    Specification spec = SpecificationFor(*manifold, epsilon);
    spec.bounding_box.reset();
    spec.seeds = RandomPointsOn(*manifold, 1, 6);
    ExpectGoodMesh(Drive(spec, *manifold), manifold->facts());
  }
}

TEST(Seeds, OnOneOfTwoComponentsFindBothOnceTheCertificateComesUponTheOther) {
  const auto manifold = Make("two-spheres");
  Specification spec = SpecificationFor(*manifold, 0.3);
  spec.bounding_box.reset();
  spec.seeds = RandomPointsOn(*manifold, 1, 7);
  const DrivenRun run = Drive(spec, *manifold);
  EXPECT_TRUE(run.report().certificate.certified) << run.report().certificate.verdict;
  EXPECT_EQ(run.report().certificate.components, 2u);
  EXPECT_EQ(run.report().certificate.euler_characteristic, 4);
}

TEST(Seeds, ThatNoClosestPointIsFoundForFailTheRun) {
  const auto manifold = Make("torus");
  for (const bool tangents : {true, false}) {
    Specification spec = SpecificationFor(*manifold, 0.3);
    spec.oracle.tangent_basis = tangents;
    const DrivenRun run = Drive(spec, [&](const QueryBatch& batch) {
      Answers answers = testing::AnswersOf(*manifold, batch);
      for (AnswerBlock& block : answers.blocks)
        block.found.assign(static_cast<std::size_t>(block.points.cols()), 0);
      return answers;
    });
    EXPECT_EQ(run.report().termination, Termination::kOracleFailed);
    EXPECT_EQ(run.report().failure.code, StatusCode::kNoSeeds);
    EXPECT_NE(run.report().failure.message.find("seed"), std::string::npos);
    EXPECT_FALSE(run.report().certificate.certified);
    EXPECT_EQ(run.mesher->NextBatch(), nullptr);
    EXPECT_EQ(run.mesher->Points().cols(), 0);
  }
}

// An eps far above the reach must be refused a certificate, or be told of.
TEST(Refinement, NeverCertifiesTheWrongTopologyQuietly) {
  const auto manifold = Make("torus");
  for (const double epsilon : {0.6, 0.9, 1.5}) {
    for (const std::uint64_t seed : {1, 2, 3}) {
      Specification spec = SpecificationFor(*manifold, epsilon);
      spec.random_seed = seed;
      const DrivenRun run = Drive(spec, *manifold);
      const Certificate& c = run.report().certificate;
      if (c.certified) {
        EXPECT_EQ(c.euler_characteristic, 0) << epsilon << " " << seed;
      } else {
        EXPECT_FALSE(c.verdict.empty());
      }
    }
  }
}

// Whoever is late with its answer still has what it was asked.
TEST(Refinement, LeavesSharedQuestionsAsTheyWere) {
  const auto manifold = Make("sphere");
  for (const int most : {0, 50}) {
    Specification spec = SpecificationFor(*manifold, 0.4);
    spec.limits.max_batch_queries = most;
    const auto mesher = testing::NewMesher(spec);
    std::shared_ptr<const QueryBatch> before;
    Eigen::MatrixXd asked;
    while (const auto batch = mesher->NextBatch()) {
      if (most == 0) {
        EXPECT_EQ(batch, mesher->NextBatch()) << "not a copy";
      }
      if (before != nullptr) {
        EXPECT_EQ(before->blocks.front().points, asked) << before->round;
      }
      before = batch;
      asked = batch->blocks.front().points;
      testing::Step(*mesher, testing::AnswererFor(*manifold));
    }
    ASSERT_NE(before, nullptr);
    EXPECT_EQ(before->blocks.front().points, asked) << "when the run is over";
    EXPECT_EQ(mesher->NextBatch(), nullptr);
  }
}

double LeastDihedralOf(const Mesher& mesher) {
  const auto points = mesher.Points();
  const std::vector<std::uint32_t> simplices = mesher.Simplices();
  double least = 180;
  for (std::size_t s = 0; s < simplices.size(); s += 4) {
    std::array<Eigen::VectorXd, 4> corners;
    for (std::size_t i = 0; i < 4; ++i) corners[i] = points.col(simplices[s + i]);
    least = std::min(least, stellate::testing::DihedralAnglesOf(corners).first);
  }
  return least;
}

// Within the size at which angles are asked for: there is no smaller simplex here.
TEST(Refinement, BoundsDihedralAnglesOfClosedManifolds) {
  for (const auto& [name, epsilon] :
       {std::pair("sphere:3", 0.3), std::pair("so3", 0.4), std::pair("flat-torus:3", 0.35)})
    for (const bool speculative : {false, true}) {
      const auto manifold = Make(name);
      Specification spec = SpecificationFor(*manifold, epsilon);
      spec.criteria.speculative = speculative;
      const DrivenRun usual = Drive(spec, *manifold);
      ExpectGoodMesh(usual, manifold->facts());
      EXPECT_GE(LeastDihedralOf(*usual.mesher), 14) << name;
      spec.criteria.sliver_bound = 0.3;
      const DrivenRun good = Drive(spec, *manifold);
      ExpectGoodMesh(good, manifold->facts());
      EXPECT_GE(LeastDihedralOf(*good.mesher), 18) << name;
      spec.criteria.sliver_bound = 0;
      EXPECT_LT(LeastDihedralOf(*Drive(spec, *manifold).mesher), 10) << name << ": R3 is off";
    }
}

// The largest bound that may be asked for, with the candidates that it takes.
TEST(Refinement, FatTetrahedraTakeTheirCandidates) {
  const auto sphere = Make("sphere:3");
  Specification spec = SpecificationFor(*sphere, 0.3);
  const std::uint64_t plain = Drive(spec, *sphere).report().counts.vertices;
  spec.criteria.sliver_bound = 0.3;
  const Report fat = Drive(spec, *sphere).report();
  EXPECT_TRUE(fat.certificate.certified) << fat.certificate.verdict;
  EXPECT_LT(static_cast<double>(fat.counts.vertices), 1.3 * static_cast<double>(plain));
}

}  // namespace
}  // namespace stellate::core
