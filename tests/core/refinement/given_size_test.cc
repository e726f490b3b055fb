// Sizes that the client gives with its answers: taken as they are, everywhere, and nothing else.

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "core/geometry/simplex.h"
#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using testing::AnswersOf;
using testing::Drive;
using testing::DrivenRun;
using testing::Make;
using testing::NewMesher;
using testing::SameMesh;
using testing::TopologyOf;

using Field = std::function<double(const Eigen::VectorXd&)>;

// A manifold under a size field of our own.
class Sized final : public Oracle {
 public:
  Sized(Oracle& inner, Field field) : inner_(inner), field_(std::move(field)) {}
  int dimension() const override { return inner_.dimension(); }
  int ambient_dimension() const override { return inner_.ambient_dimension(); }
  bool has_intersect_flat() const override { return inner_.has_intersect_flat(); }
  bool has_tangent_basis() const override { return inner_.has_tangent_basis(); }
  bool has_local_size() const override { return true; }
  Answer ClosestPoint(const Eigen::MatrixXd& x) override { return inner_.ClosestPoint(x); }
  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override {
    return inner_.IntersectFlat(centers, bases, radii);
  }
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override {
    return inner_.TangentBasis(points);
  }
  Eigen::VectorXd LocalSize(const Eigen::MatrixXd& points) override {
    Eigen::VectorXd sizes(points.cols());
    for (Eigen::Index j = 0; j < points.cols(); ++j) sizes[j] = field_(points.col(j));
    return sizes;
  }
  std::optional<stellate::BoundingBox> bounding_box() const override {
    return inner_.bounding_box();
  }

 private:
  Oracle& inner_;
  Field field_;
};

Specification SizedSpec(Oracle& oracle, double epsilon, double rate) {
  Specification spec = testing::SpecificationFor(oracle, epsilon);
  spec.oracle.local_size = true;
  spec.criteria.size_rate = rate;
  return spec;
}

// Circumradii, of all simplices: the smallest, the largest, and the largest share of the size at a
// vertex. A simplex's own is at most R_p.
struct Radii {
  double smallest = std::numeric_limits<double>::infinity(), largest = 0, largest_share = 0;
};

Radii RadiiOf(const Mesher& mesher, Oracle& sizes) {
  const Eigen::MatrixXd points = mesher.Points();
  const Eigen::VectorXd size = sizes.LocalSize(points);
  const std::vector<std::uint32_t> ids = mesher.Simplices();
  const auto corners = static_cast<std::size_t>(mesher.specification().dimension) + 1;
  Radii radii;
  for (std::size_t s = 0; s < ids.size(); s += corners) {
    std::vector<const double*> at;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < corners; ++i) {
      at.push_back(points.col(ids[s + i]).data());
      least = std::min(least, size[ids[s + i]]);
    }
    const int d = static_cast<int>(points.rows());
    const double radius =
        MeasureSimplex(SimplexVertices(at.data(), static_cast<int>(corners)), d).circumradius;
    radii.smallest = std::min(radii.smallest, radius);
    radii.largest = std::max(radii.largest, radius);
    radii.largest_share = std::max(radii.largest_share, radius / least);
  }
  return radii;
}

void ExpectCertified(const DrivenRun& run, std::int64_t euler_characteristic) {
  ASSERT_EQ(run.report().termination, Termination::kConverged);
  EXPECT_TRUE(run.report().certificate.certified) << run.report().certificate.verdict;
  const auto topology = TopologyOf(run.mesher->Simplices(), run.mesher->specification().dimension);
  EXPECT_TRUE(topology.closed);
  EXPECT_EQ(topology.euler_characteristic, euler_characteristic);
}

struct Shape {
  std::string manifold;
  double epsilon, rate;
  std::int64_t euler_characteristic;
};

void PrintTo(const Shape& s, std::ostream* out) { *out << s.manifold; }

class LocalFeatureSize : public ::testing::TestWithParam<Shape> {};

TEST_P(LocalFeatureSize, IsKeptToAtEveryVertex) {
  const auto [name, epsilon, rate, euler_characteristic] = GetParam();
  const auto manifold = Make(name);
  const DrivenRun run = Drive(SizedSpec(*manifold, epsilon, rate), *manifold);
  ExpectCertified(run, euler_characteristic);
  const Radii radii = RadiiOf(*run.mesher, *manifold);
  EXPECT_LE(radii.largest_share, rate * (1 + 1e-9));
  EXPECT_LE(radii.largest, epsilon);
  EXPECT_GT(radii.largest, 2 * radii.smallest);
  EXPECT_TRUE(run.report().certificate.warnings.empty())
      << run.report().certificate.warnings.front();
}

INSTANTIATE_TEST_SUITE_P(Catalogue, LocalFeatureSize,
                         ::testing::Values(Shape{"torus:1:0.9", 0.5, 0.4, 0},
                                           Shape{"ellipsoid:1:1:10", 0.8, 0.4, 2},
                                           Shape{"ellipsoid:1:5", 0.5, 0.2, 0},
                                           Shape{"ellipsoid:1:1:1:2@6", 0.8, 0.5, 0}));

TEST(GivenSize, SparesMostOfAThinTorus) {
  const auto torus = Make("torus:1:0.9");
  const DrivenRun graded = Drive(SizedSpec(*torus, 0.5, 0.4), *torus);
  // As fine everywhere as at the hole, where the reach is attained.
  const DrivenRun uniform =
      Drive(testing::SpecificationFor(*torus, 0.4 * *torus->facts().reach), *torus);
  EXPECT_LT(15 * graded.report().counts.vertices, uniform.report().counts.vertices);
}

// Where the estimate, from curvature, is blind.
TEST(GivenSize, SeesAnotherSheetComingNear) {
  const auto spheres = Make("two-spheres");  // of radius 1, a gap of 1 between them
  const DrivenRun given = Drive(SizedSpec(*spheres, 0.5, 0.4), *spheres);
  ExpectCertified(given, 4);
  EXPECT_LE(RadiiOf(*given.mesher, *spheres).largest_share, 0.4 * (1 + 1e-9));
  Specification spec = SizedSpec(*spheres, 0.5, 0.4);
  spec.oracle.local_size = false;
  const DrivenRun estimated = Drive(spec, *spheres);
  EXPECT_GT(RadiiOf(*estimated.mesher, *spheres).largest_share, 0.5);
}

TEST(GivenSize, MayBeAnyField) {
  const auto sphere = Make("sphere:2");
  Sized sized(*sphere, [](const Eigen::VectorXd& y) { return 0.03 + 0.15 * (1 + y[2]); });
  const DrivenRun run = Drive(SizedSpec(sized, 0.5, 1), sized);
  ExpectCertified(run, 2);
  const Radii radii = RadiiOf(*run.mesher, sized);
  EXPECT_LE(radii.largest_share, 1 + 1e-9);
  EXPECT_GT(radii.largest, 6 * radii.smallest);
  // It is no local feature size: the certificate goes by its own estimate of that.
  EXPECT_LT(run.report().certificate.epsilon_over_reach, 0.5);
}

// Vertices times the square of the size where they are, over the area of M: of a lattice whose
// circumradii are all as large as they may be 0.385; of such a mesh without one 0.68.
double Density(const Mesher& mesher, Oracle& sizes, double rate) {
  const Eigen::MatrixXd points = mesher.Points();
  const Eigen::VectorXd size = rate * sizes.LocalSize(points);
  const std::vector<std::uint32_t> ids = mesher.Simplices();
  double needed = 0;
  for (std::size_t s = 0; s < ids.size(); s += 3) {
    const Eigen::Vector3d a = points.col(ids[s]), b = points.col(ids[s + 1]),
                          c = points.col(ids[s + 2]);
    const double mean = (size[ids[s]] + size[ids[s + 1]] + size[ids[s + 2]]) / 3;
    needed += 0.5 * (b - a).cross(c - a).norm() / (mean * mean);
  }
  return static_cast<double>(points.cols()) / needed;
}

TEST(GivenSize, IsSampledByALatticeWhereItChangesSlowly) {
  const auto torus = Make("torus:1:0.9");
  const Specification spec = SizedSpec(*torus, 0.5, 0.07);
  const DrivenRun run = Drive(spec, *torus);
  ExpectCertified(run, 0);
  EXPECT_LE(RadiiOf(*run.mesher, *torus).largest_share, 0.07 * (1 + 1e-9));
  EXPECT_LT(Density(*run.mesher, *torus, 0.07), 0.58);
  // Ring by ring, and without simplices meanwhile.
  EXPECT_GT(run.deltas[2].first_vertex, run.deltas[1].first_vertex);
  EXPECT_TRUE(run.deltas[2].added.empty());
  EXPECT_TRUE(SameMesh(*run.mesher, *Drive(spec, *torus, {.threads = 3}).mesher));
}

// A lattice cannot follow it, and is given up before it costs rounds.
TEST(GivenSize, MayChangeWithinASimplex) {
  const auto sphere = Make("sphere:2");
  Sized sized(*sphere, [](const Eigen::VectorXd& y) {
    return 0.06 + 0.04 * std::sin(1e4 * y[0] + 7e3 * y[1]);
  });
  const DrivenRun run = Drive(SizedSpec(sized, 0.1, 1), sized);
  ExpectCertified(run, 2);
  EXPECT_LE(RadiiOf(*run.mesher, sized).largest_share, 1 + 1e-9);
  EXPECT_LT(run.report().counts.rounds, 70u);
}

TEST(GivenSize, AllowsForADeviation) {
  const auto torus = Make("torus:1:0.9");
  Specification spec = SizedSpec(*torus, 0.5, 1);
  spec.criteria.size_rate.reset();
  spec.criteria.max_deviation = 0.01;
  const DrivenRun run = Drive(spec, *torus);
  ExpectCertified(run, 0);
  EXPECT_LE(run.report().certificate.max_barycentre_distance, 0.01);
  EXPECT_GT(run.report().certificate.max_barycentre_distance, 0.001) << "far too fine";
}

TEST(GivenSize, IsNoLargerThanEpsilon) {
  const auto torus = Make("torus");
  Sized large(*torus, [](const Eigen::VectorXd&) { return 10.0; });
  for (const double epsilon : {0.3, 0.05}) {  // star by star, and by a lattice
    const DrivenRun plain = Drive(testing::SpecificationFor(*torus, epsilon), *torus);
    EXPECT_TRUE(SameMesh(*plain.mesher, *Drive(SizedSpec(large, epsilon, 1), large).mesher));
  }
}

TEST(GivenSize, IsNotAskedForWithoutACriterion) {
  const auto torus = Make("torus");
  const DrivenRun plain = Drive(testing::SpecificationFor(*torus, 0.3), *torus);
  Specification spec = testing::SpecificationFor(*torus, 0.3);
  spec.oracle.local_size = true;
  const DrivenRun same = Drive(spec, [&](const QueryBatch& batch) {
    for (const QueryBlock& block : batch.blocks) EXPECT_FALSE(block.want.sizes);
    return AnswersOf(*torus, batch);
  });
  EXPECT_TRUE(SameMesh(*plain.mesher, *same.mesher));
}

TEST(GivenSize, HelpsToFindTangents) {
  const auto ellipsoid = Make("ellipsoid:1:1:20");  // at the tips the reach is 0.05
  Specification spec = SizedSpec(*ellipsoid, 2, 0.4);
  spec.oracle.intersect_flat = spec.oracle.tangent_basis = false;
  const DrivenRun run = Drive(spec, *ellipsoid);
  ExpectCertified(run, 2);
  EXPECT_LE(RadiiOf(*run.mesher, *ellipsoid).largest_share, 0.4 * (1 + 1e-9));
}

TEST(GivenSize, IsGuessedInASpeculativeRun) {
  const auto torus = Make("torus:1:0.9");
  Specification spec = SizedSpec(*torus, 0.5, 0.2);
  const DrivenRun plain = Drive(spec, *torus);
  spec.criteria.speculative = true;
  const DrivenRun ahead = Drive(spec, *torus);
  ExpectCertified(ahead, 0);
  EXPECT_LE(RadiiOf(*ahead.mesher, *torus).largest_share, 0.2 * (1 + 1e-9));
  EXPECT_LT(2 * ahead.report().counts.rounds, plain.report().counts.rounds);
  // A plain run samples by a lattice, a speculative one star by star.
  EXPECT_LT(static_cast<double>(ahead.report().counts.vertices),
            1.3 * static_cast<double>(plain.report().counts.vertices));
}

TEST(GivenSize, IsDeterministicHoweverItIsCut) {
  const auto torus = Make("torus:1:0.9");
  Specification spec = SizedSpec(*torus, 0.5, 0.5);
  const DrivenRun one = Drive(spec, *torus, {.threads = 1});
  EXPECT_TRUE(SameMesh(*one.mesher, *Drive(spec, *torus, {.threads = 3}).mesher));
  spec.limits.max_batch_queries = 7;
  const DrivenRun cut = Drive(spec, *torus);
  EXPECT_EQ(cut.mesher->Points(), one.mesher->Points());
  EXPECT_EQ(cut.mesher->Simplices(), one.mesher->Simplices());
}

// A field that vanishes at a point can never be kept to there.
TEST(GivenSize, ThatIsTooSmallIsAWarning) {
  const auto sphere = Make("sphere:2");
  const Eigen::Vector3d pole = Eigen::Vector3d(1, 2, -2) / 3;
  Sized sized(*sphere, [&](const Eigen::VectorXd& y) { return 1e-12 + (y - pole).norm(); });
  const DrivenRun run = Drive(SizedSpec(sized, 0.4, 0.5), sized);
  ExpectCertified(run, 2);
  ASSERT_EQ(run.report().certificate.warnings.size(), 1u);
  EXPECT_NE(run.report().certificate.warnings[0].find("sizes given"), std::string::npos)
      << run.report().certificate.warnings[0];
  EXPECT_LT(run.report().counts.vertices, 3000u);
}

// Sizes that break a rule are refused with the batch, and forgotten when it is answered rightly.

struct Lie {
  std::string name;
  StatusCode code;
  std::function<bool(const QueryBatch&, Answers&)> tell;  // false: no occasion
};

void PrintTo(const Lie& lie, std::ostream* out) { *out << lie.name; }

// At the last point that was found, where there is one.
Lie Instead(const std::string& name, double size, StatusCode code) {
  return {name, code, [size](const QueryBatch& batch, Answers& answers) {
            if (!batch.blocks[0].want.sizes) return false;
            AnswerBlock& block = answers.blocks[0];
            for (Eigen::Index j = batch.blocks[0].size() - 1; j >= 0; --j) {
              if (!block.found.empty() && !block.found[static_cast<std::size_t>(j)]) continue;
              block.sizes[j] = size;
              return true;
            }
            return false;
          }};
}

const Lie kLies[] = {
    Instead("NaN", std::nan(""), StatusCode::kOracleNotFinite),
    Instead("infinity", HUGE_VAL, StatusCode::kOracleNotFinite),
    Instead("zero", 0, StatusCode::kOracleBadSize),
    Instead("negative", -0.1, StatusCode::kOracleBadSize),
    Instead("denormal", 1e-310, StatusCode::kOracleBadSize),
    {"one too few", StatusCode::kOracleShape,
     [](const QueryBatch& batch, Answers& answers) {
       if (!batch.blocks[0].want.sizes || batch.blocks[0].size() < 2) return false;
       answers.blocks[0].sizes.conservativeResize(batch.blocks[0].size() - 1);
       return true;
     }},
    {"one too many", StatusCode::kOracleShape,
     [](const QueryBatch& batch, Answers& answers) {
       if (!batch.blocks[0].want.sizes) return false;
       answers.blocks[0].sizes = Eigen::VectorXd::Ones(batch.blocks[0].size() + 1);
       return true;
     }},
    {"none", StatusCode::kOracleShape,
     [](const QueryBatch& batch, Answers& answers) {
       const auto& found = answers.blocks[0].found;
       if (!batch.blocks[0].want.sizes || !std::count(found.begin(), found.end(), 1)) return false;
       answers.blocks[0].sizes.resize(0);
       return true;
     }},
    {"another for the same point", StatusCode::kOracleBadSize,
     [](const QueryBatch& batch, Answers& answers) {
       if (batch.round != 2) return false;  // the one that asks for answered points again
       answers.blocks.back().sizes *= 1.2;
       return true;
     }},
};

class SizeLies : public ::testing::TestWithParam<Lie> {};

TEST_P(SizeLies, AreRefusedAndForgotten) {
  const auto torus = Make("torus");
  const Specification spec = SizedSpec(*torus, 0.4, 0.5);
  const DrivenRun right = Drive(spec, *torus);
  const auto mesher = NewMesher(spec);
  int refusals = 0;
  while (const auto batch = mesher->NextBatch()) {
    Answers answers = AnswersOf(*torus, *batch), spoilt = answers;
    if (GetParam().tell(*batch, spoilt)) {
      const auto delta = mesher->Absorb(spoilt);
      ASSERT_FALSE(delta.has_value()) << "round " << batch->round;
      EXPECT_STREQ(StatusCodeName(delta.error().code), StatusCodeName(GetParam().code))
          << delta.error().message;
      EXPECT_NE(delta.error().message.find("size"), std::string::npos) << delta.error().message;
      ++refusals;
    }
    ASSERT_TRUE(mesher->Absorb(answers).has_value());
  }
  EXPECT_GT(refusals, 0);
  EXPECT_TRUE(SameMesh(*mesher, *right.mesher));
}

INSTANTIATE_TEST_SUITE_P(All, SizeLies, ::testing::ValuesIn(kLies));

TEST(GivenSize, MayBeTenPercentOffWhenToldAgain) {
  const auto torus = Make("torus");
  const Specification spec = SizedSpec(*torus, 0.4, 0.5);
  const DrivenRun right = Drive(spec, *torus);
  const DrivenRun run = Drive(spec, [&](const QueryBatch& batch) {
    Answers answers = AnswersOf(*torus, batch);
    if (batch.round == 2) answers.blocks.back().sizes *= 1.09;
    return answers;
  });
  EXPECT_TRUE(SameMesh(*run.mesher, *right.mesher)) << "what was told first counts";
}

// Nothing is asked of places where nothing was found.
TEST(GivenSize, IsIgnoredWhereNothingWasFound) {
  const auto torus = Make("torus");
  const Specification spec = SizedSpec(*torus, 0.4, 0.5);
  const DrivenRun run = Drive(spec, [&](const QueryBatch& batch) {
    Answers answers = AnswersOf(*torus, batch);
    for (AnswerBlock& block : answers.blocks)
      for (std::size_t j = 0; j < block.found.size() && block.sizes.size() > 0; ++j)
        if (!block.found[j]) block.sizes[static_cast<Eigen::Index>(j)] = -1;
    return answers;
  });
  ExpectCertified(run, 0);
}

}  // namespace
}  // namespace stellate::core
