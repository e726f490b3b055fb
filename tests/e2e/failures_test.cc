// Bad requests and lying oracles through the client: each refused by name, with the offending
// value, and without harm to other meshes of the server.
#include <Eigen/Geometry>
#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <ostream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "live.h"
#include "support/mesh_judge.h"
#include "support/spoiled_oracle.h"

namespace stellate::testing {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Refused {
  std::string name;
  std::function<void(SpoiledOracle&, MeshOptions&)> spoil;
  std::string reason, mentions;
};
void PrintTo(const Refused& c, std::ostream* out) { *out << c.name; }

class BadRequest : public Live, public ::testing::WithParamInterface<Refused> {};

TEST_P(BadRequest, IsRefusedByNameAndValue) {
  const auto torus = Make("torus:1:0.4");
  SpoiledOracle oracle(*torus);
  MeshOptions options = At(0.2);
  GetParam().spoil(oracle, options);
  const Expected<Mesh> mesh = MeshManifold(oracle, options);
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kRefused) << mesh.error().message;
  EXPECT_EQ(mesh.error().reason, GetParam().reason) << mesh.error().message;
  EXPECT_NE(mesh.error().message.find(GetParam().mentions), std::string::npos)
      << mesh.error().message;
}

Refused Epsilon(const std::string& name, double epsilon) {
  return {name, [epsilon](SpoiledOracle&, MeshOptions& o) { o.epsilon = epsilon; },
          "INVALID_ARGUMENT", "epsilon"};
}
Refused Option(const std::string& name, std::function<void(MeshOptions&)> set,
               const std::string& mentions) {
  return {name, [set](SpoiledOracle&, MeshOptions& o) { set(o); }, "INVALID_ARGUMENT", mentions};
}
Refused Box(const std::string& name, std::function<void(BoundingBox&)> spoil) {
  return {name, [spoil](SpoiledOracle& oracle, MeshOptions&) { spoil(*oracle.box); },
          "INVALID_ARGUMENT", "bounding_box"};
}

INSTANTIATE_TEST_SUITE_P(
    Each, BadRequest,
    ::testing::Values(
        Epsilon("zero", 0), Epsilon("negative", -0.1), Epsilon("nan", kNaN),
        Epsilon("infinite", kInfinity),
        Refused{"k_zero", [](SpoiledOracle& o, MeshOptions&) { o.k = 0; }, "INVALID_ARGUMENT",
                "dimension is 0"},
        Refused{"k_equals_d", [](SpoiledOracle& o, MeshOptions&) { o.k = 3; }, "INVALID_ARGUMENT",
                "dimension"},
        Refused{"k_too_large",
                [](SpoiledOracle& o, MeshOptions&) {
                  o.k = 6;
                  o.d = 9;
                  o.box = BoundingBox{-Eigen::VectorXd::Ones(9), Eigen::VectorXd::Ones(9)};
                },
                "LIMIT_EXCEEDED", "dimension"},
        Refused{"d_too_large",
                [](SpoiledOracle& o, MeshOptions&) {
                  o.d = 5000;
                  o.box = BoundingBox{-Eigen::VectorXd::Ones(5000), Eigen::VectorXd::Ones(5000)};
                },
                "LIMIT_EXCEEDED", "5000"},
        Box("inverted_box", [](BoundingBox& b) { std::swap(b.lower, b.upper); }),
        Box("flat_box", [](BoundingBox& b) { b.upper[1] = b.lower[1]; }),
        Box("nan_box", [](BoundingBox& b) { b.lower[2] = kNaN; }),
        Box("box_of_another_size", [](BoundingBox& b) { b.lower = Eigen::VectorXd::Zero(2); }),
        Refused{"neither_box_nor_seeds", [](SpoiledOracle& o, MeshOptions&) { o.box.reset(); },
                "INVALID_ARGUMENT", "seeds"},
        Refused{"seeds_of_another_size",
                [](SpoiledOracle& o, MeshOptions&) { o.given_seeds = Eigen::MatrixXd::Ones(4, 2); },
                "INVALID_ARGUMENT", "seeds"},
        Refused{"nan_seed",
                [](SpoiledOracle& o, MeshOptions&) { o.given_seeds = Eigen::Vector3d(0, kNaN, 0); },
                "INVALID_ARGUMENT", "seeds"},
        Option(
            "radius_edge", [](MeshOptions& o) { o.radius_edge_bound = 0.5; }, "radius_edge_bound"),
        Option(
            "sliver", [](MeshOptions& o) { o.sliver_bound = 0.9; }, "sliver_bound"),
        Option(
            "picking_radius", [](MeshOptions& o) { o.picking_radius = -1; }, "picking_radius"),
        Option(
            "candidates", [](MeshOptions& o) { o.candidates = 1000; }, "candidates"),
        Option(
            "workers", [](MeshOptions& o) { o.workers = 0; }, "workers")),
    [](const auto& request) { return request.param.name; });

struct Lie {
  std::string name;
  std::function<void(SpoiledOracle&)> spoil;
  std::string reason;
};
void PrintTo(const Lie& c, std::ostream* out) { *out << c.name; }

class LyingOracle : public Live, public ::testing::WithParamInterface<Lie> {};

TEST_P(LyingOracle, IsCaught) {
  const auto torus = Make("torus:1:0.4");
  SpoiledOracle oracle(*torus);
  GetParam().spoil(oracle);
  const Expected<Mesh> mesh = MeshManifold(oracle, At(0.2));
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kOracleFailed) << mesh.error().message;
  EXPECT_EQ(mesh.error().reason, GetParam().reason) << mesh.error().message;
  EXPECT_FALSE(mesh.error().message.empty());
}

Lie Closest(const std::string& name, std::function<void(const Eigen::MatrixXd&, Answer&)> spoil,
            const std::string& reason) {
  return {name, [spoil](SpoiledOracle& oracle) { oracle.on_closest = spoil; }, reason};
}
Lie Flat(const std::string& name,
         std::function<void(const Eigen::MatrixXd&, const Eigen::MatrixXd&, const Eigen::VectorXd&,
                            Answer&)>
             spoil,
         const std::string& reason) {
  return {name, [spoil](SpoiledOracle& oracle) { oracle.on_flat = spoil; }, reason};
}
Lie Tangents(const std::string& name, std::function<void(Eigen::MatrixXd&)> spoil,
             const std::string& reason) {
  return {name, [spoil](SpoiledOracle& oracle) { oracle.on_tangents = spoil; }, reason};
}

INSTANTIATE_TEST_SUITE_P(
    Each, LyingOracle,
    ::testing::Values(
        Closest(
            "too_few_points",
            [](const auto&, Answer& a) {
              a.points = Eigen::MatrixXd(a.points.leftCols(a.points.cols() - 1));
              a.found.pop_back();
            },
            "ORACLE_SHAPE"),
        Closest(
            "points_of_another_dimension",
            [](const auto&, Answer& a) { a.points = Eigen::MatrixXd(a.points.topRows(2)); },
            "ORACLE_SHAPE"),
        Closest(
            "found_flags_of_another_count", [](const auto&, Answer& a) { a.found.push_back(1); },
            "ORACLE_SHAPE"),
        Closest(
            "nan", [](const auto&, Answer& a) { a.points(1, a.points.cols() - 1) = kNaN; },
            "ORACLE_NOT_FINITE"),
        Closest(
            "infinity", [](const auto&, Answer& a) { a.points(0, 0) = kInfinity; },
            "ORACLE_NOT_FINITE"),
        Closest(
            "not_idempotent", [](const auto&, Answer& a) { a.points.array() += 0.03; },
            "ORACLE_NOT_IDEMPOTENT"),
        Closest(
            "nothing_is_ever_found",
            [](const auto&, Answer& a) { a.found.assign(a.found.size(), 0); }, "NO_SEEDS"),
        Flat(
            "off_the_flat",
            [](const auto&, const Eigen::MatrixXd& bases, const auto&, Answer& a) {
              // A step along the first tangent vector leaves the flat.
              for (Eigen::Index j = 0; j < a.points.cols(); ++j) {
                for (int i = 0; i < 3; ++i) a.points(i, j) += 1e-2 * bases(2 * i, j);
              }
            },
            "ORACLE_OFF_FLAT"),
        Flat(
            "outside_the_radius",
            [](const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
               const Eigen::VectorXd& radii, Answer& a) {
              // Along the normal: in the flat, but too far.
              for (Eigen::Index j = 0; j < a.points.cols(); ++j) {
                const Eigen::Vector3d u(bases(0, j), bases(2, j), bases(4, j));
                const Eigen::Vector3d v(bases(1, j), bases(3, j), bases(5, j));
                a.points.col(j) = centers.col(j) + 1.5 * radii[j] * u.cross(v);
                a.found[static_cast<size_t>(j)] = 1;
              }
            },
            "ORACLE_OUTSIDE_RADIUS"),
        Tangents(
            "stretched", [](Eigen::MatrixXd& bases) { bases *= 1.1; }, "ORACLE_BAD_TANGENT"),
        Tangents(
            "the_same_vector_twice",
            [](Eigen::MatrixXd& bases) {
              for (int i = 0; i < 3; ++i) bases.row(2 * i + 1) = bases.row(2 * i);
            },
            "ORACLE_BAD_TANGENT"),
        Tangents(
            "nan_tangents", [](Eigen::MatrixXd& bases) { bases(0, 0) = kNaN; },
            "ORACLE_NOT_FINITE"),
        Tangents(
            "too_few_vectors",
            [](Eigen::MatrixXd& bases) { bases = Eigen::MatrixXd(bases.topRows(3)); },
            "ORACLE_SHAPE")),
    [](const auto& lie) { return lie.param.name; });

class Failures : public Live {};

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

TEST_F(Failures, HarmNoOtherMesh) {
  const auto torus = Make("torus:1:0.4");
  const Expected<Mesh> undisturbed = MeshManifold(*torus, At(0.08));
  ASSERT_TRUE(undisturbed.has_value());
  // The same mesh again, slowed down to last while others fail all around it.
  std::atomic<int> failures_left = 6;
  SpoiledOracle slow(*torus);
  slow.on_flat = [&](const auto&, const auto&, const auto&, Answer&) {
    if (failures_left > 0) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  };
  Expected<Mesh> disturbed = Fail(ErrorCode::kServerFailed, "not meshed");
  std::thread good([&] { disturbed = MeshManifold(slow, At(0.08)); });
  while (failures_left > 0) {
    SpoiledOracle liar(*torus);
    liar.on_closest = [](const auto&, Answer& a) { a.points(0, 0) = kNaN; };
    EXPECT_FALSE(MeshManifold(liar, At(0.1)).has_value());
    liar.on_closest = [](const auto&, Answer&) { throw Strange{1}; };
    EXPECT_THROW(static_cast<void>(MeshManifold(liar, At(0.1))), Strange);
    EXPECT_FALSE(MeshManifold(*torus, At(-1)).has_value());
    --failures_left;
  }
  good.join();
  ASSERT_TRUE(disturbed.has_value()) << disturbed.error().message;
  EXPECT_TRUE(AreIdentical(*undisturbed, *disturbed));
}

TEST_F(Failures, AServerThatIsNotThereIsReported) {
  const auto torus = Make("torus:1:0.4");
  MeshOptions options = At(0.1);
  options.server = "unix:/nowhere/at/all";
  const Expected<Mesh> mesh = MeshManifold(*torus, options);
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kServerFailed);
  EXPECT_FALSE(CheckHealth("unix:/nowhere/at/all").has_value());
}

TEST_F(Failures, HealthKnowsTheServer) {
  const auto health = CheckHealth(Server());
  ASSERT_TRUE(health.has_value()) << health.error().message;
  EXPECT_TRUE(health->serving);
  EXPECT_FALSE(health->version.empty());
  EXPECT_EQ(health->protocols, std::vector<std::string>{"stellate.v1"});
  EXPECT_GE(health->max_dimension, 5u);
}

}  // namespace
}  // namespace stellate::testing
