// What goes wrong, as callers of the C++ client are told of it.
#include <stdexcept>
#include <string>
#include <vector>

#include "live.h"
#include "support/spoiled_oracle.h"

namespace stellate::testing {
namespace {

class Failures : public Live {};

// What else the server refuses is tried in python/test_failures.py.
TEST_F(Failures, ARequestIsRefusedByNameAndValue) {
  const auto torus = Make("torus:1:0.4");
  const auto refused = [](Oracle& oracle, const MeshOptions& options, const char* mentions) {
    const Expected<Mesh> mesh = MeshManifold(oracle, options);
    ASSERT_FALSE(mesh.has_value());
    EXPECT_EQ(mesh.error().code, ErrorCode::kRefused) << mesh.error().message;
    EXPECT_EQ(mesh.error().reason, "INVALID_ARGUMENT") << mesh.error().message;
    EXPECT_NE(mesh.error().message.find(mentions), std::string::npos) << mesh.error().message;
  };
  refused(*torus, At(-0.1), "epsilon");
  SpoiledOracle oracle(*torus);
  oracle.box->lower = Eigen::VectorXd::Zero(2);
  refused(oracle, At(0.2), "bounding_box");
  oracle.box.reset();
  oracle.given_seeds = Eigen::MatrixXd::Ones(4, 2);
  refused(oracle, At(0.2), "seeds");
}

// What breaks a rule in a good shape is tried in python/test_failures.py.
TEST_F(Failures, AnswersOfTheWrongShapeAreTheOracles) {
  const auto torus = Make("torus:1:0.4");
  const auto caught = [&](const char* what, const auto& spoil) {
    SpoiledOracle oracle(*torus);
    spoil(oracle);
    const Expected<Mesh> mesh = MeshManifold(oracle, At(0.2));
    ASSERT_FALSE(mesh.has_value()) << what;
    EXPECT_EQ(mesh.error().code, ErrorCode::kOracleFailed) << what << ": " << mesh.error().message;
    EXPECT_EQ(mesh.error().reason, "ORACLE_SHAPE") << what << ": " << mesh.error().message;
  };
  caught("too few points", [](SpoiledOracle& oracle) {
    oracle.on_closest = [](const auto&, Answer& a) {
      a.points = Eigen::MatrixXd(a.points.leftCols(a.points.cols() - 1));
      a.found.pop_back();
    };
  });
  caught("points of another dimension", [](SpoiledOracle& oracle) {
    oracle.on_closest = [](const auto&, Answer& a) {
      a.points = Eigen::MatrixXd(a.points.topRows(2));
    };
  });
  caught("a flag too many", [](SpoiledOracle& oracle) {
    oracle.on_closest = [](const auto&, Answer& a) { a.found.push_back(1); };
  });
  caught("too few vectors", [](SpoiledOracle& oracle) {
    oracle.on_tangents = [](Eigen::MatrixXd& b) { b = Eigen::MatrixXd(b.topRows(3)); };
  });
}

struct Strange {
  int query;
};

TEST_F(Failures, AnExceptionReachesTheCallerAsItself) {
  const auto torus = Make("torus:1:0.4");
  SpoiledOracle oracle(*torus);
  int calls = 0;
  oracle.on_flat = [&](const auto&, const auto&, const auto&, Answer&) {
    if (++calls == 3) throw std::domain_error("the third batch is too much");
  };
  try {
    const Expected<Mesh> mesh = MeshManifold(oracle, At(0.1));
    FAIL() << "nothing was thrown";
  } catch (const std::domain_error& error) {
    EXPECT_STREQ(error.what(), "the third batch is too much");
  }
  oracle.on_closest = [](const auto&, Answer&) { throw Strange{7}; };
  try {
    const Expected<Mesh> mesh = MeshManifold(oracle, At(0.1));
    FAIL() << "nothing was thrown";
  } catch (const Strange& strange) {
    EXPECT_EQ(strange.query, 7);
  }
}

TEST_F(Failures, WhatOnProgressThrowsReachesTheCaller) {
  const auto torus = Make("torus:1:0.4");
  MeshOptions options = At(0.1);
  options.on_progress = [](const Progress&) { throw std::domain_error("enough"); };
  EXPECT_THROW(static_cast<void>(MeshManifold(*torus, options)), std::domain_error);
}

TEST_F(Failures, AServerThatIsNotThereIsReported) {
  const auto torus = Make("torus:1:0.4");
  MeshOptions options = At(0.1);
  options.connection.server = "unix:/nowhere/at/all";
  const Expected<Mesh> mesh = MeshManifold(*torus, options);
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kServerFailed);
  EXPECT_FALSE(CheckHealth({"unix:/nowhere/at/all"}).has_value());
}

TEST_F(Failures, HealthKnowsTheServer) {
  const auto health = CheckHealth({Server()});
  ASSERT_TRUE(health.has_value()) << health.error().message;
  EXPECT_TRUE(health->serving);
  EXPECT_FALSE(health->version.empty());
  EXPECT_EQ(health->protocols, std::vector<std::string>{"stellate.v1"});
  EXPECT_GE(health->max_dimension, 5u);
}

}  // namespace
}  // namespace stellate::testing
