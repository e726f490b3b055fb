#include "core/specification.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "core/base/infinity.h"
#include "core/execution.h"
#include "core/report.h"
#include "tests/core/support/nan.h"

namespace stellate::core {
namespace {

using testing::kNaN;

Specification Good() {
  Specification spec;
  spec.dimension = 2;
  spec.ambient_dimension = 3;
  spec.epsilon = 0.1;
  spec.bounding_box = BoundingBox{Eigen::Vector3d(-1, -1, -1), Eigen::Vector3d(1, 1, 1)};
  return spec;
}

void SetWalls(int walls, Specification* spec) {
  spec->walls = walls;
  spec->oracle.conormals = spec->oracle.tangent_basis = true;
}

struct BadCase {
  const char* words;  // the message names the field and holds the value
  std::function<void(Specification&)> spoil;
  StatusCode code = StatusCode::kInvalidArgument;
};

TEST(Validate, RefusesNegativeThreads) {
  EXPECT_TRUE(Validate(Execution{}).ok());
  const Status status = Validate(Execution{.threads = -2});
  EXPECT_EQ(status.code, StatusCode::kInvalidArgument);
  EXPECT_EQ(status.field, "threads");
  EXPECT_NE(status.message.find("threads is -2 "), std::string::npos) << status.message;
}

TEST(Validate, AcceptsWhatIsMeant) {
  EXPECT_EQ(Validate(Good()).message, "");
  EXPECT_TRUE(Validate(Good()).ok());
  Specification seeds = Good();
  seeds.bounding_box.reset();
  seeds.seeds = Eigen::MatrixXd::Ones(3, 2);
  EXPECT_TRUE(Validate(seeds).ok());
  for (int k = 1; k <= kMaxDimension; ++k) {
    Specification spec = seeds;
    spec.dimension = k;
    spec.ambient_dimension = kMaxAmbientDimension;
    spec.seeds = Eigen::MatrixXd::Zero(kMaxAmbientDimension, 1);
    EXPECT_TRUE(Validate(spec).ok()) << k;
  }
  for (const double scale : {1e-6, 1e6}) {
    Specification spec = Good();
    spec.epsilon *= scale;
    spec.bounding_box->lower *= scale;
    spec.bounding_box->upper *= scale;
    EXPECT_TRUE(Validate(spec).ok()) << scale;
  }
}

TEST(Validate, NamesTheFieldAndTheValueOfWhatItRefuses) {
  const std::vector<BadCase> cases = {
      {"dimension (k) is 0 ", [](auto& s) { s.dimension = 0; }},
      {"dimension (k) is -3 ", [](auto& s) { s.dimension = -3; }},
      {"dimension (k) is 3 and ambient_dimension (d) is 3 ", [](auto& s) { s.dimension = 3; }},
      {"dimension (k) is 6 ",
       [](auto& s) {
         s.dimension = 6;
         s.ambient_dimension = 9;
       },
       StatusCode::kLimitExceeded},
      {"ambient_dimension (d) is 4097 ", [](auto& s) { s.ambient_dimension = 4097; },
       StatusCode::kLimitExceeded},
      {"epsilon is 0 ", [](auto& s) { s.epsilon = 0; }},
      {"epsilon is -0.25 ", [](auto& s) { s.epsilon = -0.25; }},
      {"epsilon is NaN ", [](auto& s) { s.epsilon = kNaN; }},
      {"epsilon is inf ", [](auto& s) { s.epsilon = kInfinity; }},
      {"epsilon is 1e-300 ", [](auto& s) { s.epsilon = 1e-300; }},
      {"bounding_box.lower has 2 coordinates",
       [](auto& s) { s.bounding_box->lower = Eigen::Vector2d(0, 0); }},
      {"bounding_box.upper is NaN in coordinate 1",
       [](auto& s) { s.bounding_box->upper[1] = kNaN; }},
      {"bounding_box is empty in coordinate 2: lower is 5 and upper is 1",
       [](auto& s) { s.bounding_box->lower[2] = 5; }},
      {"bounding_box is empty in coordinate 0: lower is 1 and upper is 1",
       [](auto& s) { s.bounding_box->lower[0] = 1; }},
      {"neither seeds nor bounding_box", [](auto& s) { s.bounding_box.reset(); }},
      {"seeds have 4 coordinates", [](auto& s) { s.seeds = Eigen::MatrixXd::Zero(4, 1); }},
      {"seeds is inf in coordinate 2 of seed 1",
       [](auto& s) {
         s.seeds = Eigen::MatrixXd::Zero(3, 2);
         s.seeds(2, 1) = kInfinity;
       }},
      {"box_seeds is -1 ", [](auto& s) { s.box_seeds = -1; }},
      {"box_seeds is 100001 ", [](auto& s) { s.box_seeds = 100001; }},
      {"box_seeds is 100000 but in R^3000 may be at most 1333",
       [](auto& s) {
         s.ambient_dimension = 3000;
         s.bounding_box = BoundingBox{Eigen::VectorXd::Zero(3000), Eigen::VectorXd::Ones(3000)};
         s.box_seeds = 100000;
       },
       StatusCode::kLimitExceeded},
      {"criteria.radius_edge_bound (rho0) is 1 ",
       [](auto& s) { s.criteria.radius_edge_bound = 1; }},
      {"criteria.radius_edge_bound (rho0) is NaN ",
       [](auto& s) { s.criteria.radius_edge_bound = kNaN; }},
      {"criteria.sliver_bound (Theta0) is 0.31 ", [](auto& s) { s.criteria.sliver_bound = 0.31; }},
      {"criteria.sliver_bound (Theta0) is -0.1 ", [](auto& s) { s.criteria.sliver_bound = -0.1; }},
      {"criteria.picking_radius (delta) is 1 ", [](auto& s) { s.criteria.picking_radius = 1; }},
      {"criteria.picking_radius (delta) is 0 ", [](auto& s) { s.criteria.picking_radius = 0; }},
      {"criteria.small_sliver_radius (beta) is 0.5 ",
       [](auto& s) { s.criteria.small_sliver_radius = 0.5; }},
      {"criteria.candidates is 0 ", [](auto& s) { s.criteria.candidates = 0; }},
      {"criteria.candidates is 101 ", [](auto& s) { s.criteria.candidates = 101; }},
      {"criteria.advance_step (h) is -1 ", [](auto& s) { s.criteria.advance_step = -1; }},
      {"criteria.flat_alternations is 21 ", [](auto& s) { s.criteria.flat_alternations = 21; }},
      {"limits.max_vertices is 0 ", [](auto& s) { s.limits.max_vertices = 0; }},
      {"limits.max_vertices is 4294967296 ",
       [](auto& s) { s.limits.max_vertices = std::uint64_t{1} << 32; }, StatusCode::kLimitExceeded},
      {"limits.max_rounds is 0 ", [](auto& s) { s.limits.max_rounds = 0; }},
      {"labels are set without walls",
       [](auto& s) {
         s.labels = {0, 1};
       }},
      {"labels has 3 entries where 2 walls have 4 ",
       [](auto& s) {
         SetWalls(2, &s);
         s.labels = {0, 1, 1};
       }},
      {"labels[1] is -2 ",
       [](auto& s) {
         SetWalls(1, &s);
         s.labels = {0, -2};
       }},
      {"labels are all 0",
       [](auto& s) {
         SetWalls(1, &s);
         s.labels = {0, 0};
       }},
      {"labels are set for 17 walls but at most 16 ",
       [](auto& s) {
         SetWalls(17, &s);
         s.labels.assign(std::size_t{1} << 17, 1);
       },
       StatusCode::kLimitExceeded},
      {"closures are set without labels",
       [](auto& s) {
         SetWalls(3, &s);
         s.closures = {7};
       }},
      {"closures[1] is of walls 0, 3 but must be of three walls or more, each below 3",
       [](auto& s) {
         SetWalls(3, &s);
         s.labels.assign(8, 1);
         s.closures = {7, 9};
       }},
      {"closures has 1001 sets but may have at most 1000",
       [](auto& s) {
         SetWalls(3, &s);
         s.labels.assign(8, 1);
         s.closures.assign(1001, 7);
       },
       StatusCode::kLimitExceeded},
      {"criteria.speculative is set together with labels",
       [](auto& s) {
         SetWalls(1, &s);
         s.labels = {0, 1};
         s.criteria.speculative = true;
       }},
  };
  for (const BadCase& bad : cases) {
    Specification spec = Good();
    bad.spoil(spec);
    const Status status = Validate(spec);
    EXPECT_EQ(status.code, bad.code) << bad.words;
    EXPECT_NE(status.message.find(bad.words), std::string::npos)
        << "\"" << bad.words << "\" is not in \"" << status.message << "\"";
    EXPECT_NE(status.field, "");
    EXPECT_TRUE(status.message.starts_with(status.field) ||
                status.message.starts_with("neither seeds nor " + status.field))
        << status.field << ": " << status.message;
  }
}

TEST(Names, AreDistinctAndKnown) {
  EXPECT_STREQ(TerminationName(Termination::kConverged), "CONVERGED");
  EXPECT_STREQ(TerminationName(Termination::kNoProgress), "NO_PROGRESS");
  EXPECT_STREQ(PhaseName(Phase::kSeeding), "SEEDING");
  EXPECT_STREQ(PhaseName(Phase::kDone), "DONE");
}

}  // namespace
}  // namespace stellate::core
