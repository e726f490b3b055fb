// Manifolds with boundary, from C++ through the real server; topology is counted here.
#include "stellate/oracles/walls.h"

#include <cmath>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "faces.h"
#include "live.h"
#include "stellate/download.h"
#include "stellate/oracles/combined.h"
#include "stellate/serve.h"

namespace stellate::testing {
namespace {

using Eigen::MatrixXd, Eigen::VectorXd;
using oracles::Ball, oracles::Box, oracles::Clipped, oracles::HalfSpace, oracles::Solid;

struct DomainCase {
  std::string spec;
  double epsilon;
  int euler;
  size_t walls, edge_faces, corners;  // in the mesh
};
void PrintTo(const DomainCase& c, std::ostream* out) { *out << c.spec << " at " << c.epsilon; }

class EveryDomain : public Live, public ::testing::WithParamInterface<DomainCase> {};

TEST_P(EveryDomain, IsMeshedUpToItsWalls) {
  const DomainCase& want = GetParam();
  const auto domain = oracles::MakeDomain(want.spec).value();
  const Expected<Mesh> mesh = MeshManifold(*domain, At(want.epsilon));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().reason << ": " << mesh.error().message;
  const Certificate& certificate = mesh->report.certificate;
  ASSERT_TRUE(certificate.certified) << mesh->report.text;
  EXPECT_EQ(Euler(mesh->simplices), want.euler);
  EXPECT_EQ(certificate.euler_characteristic, want.euler);
  EXPECT_EQ(certificate.orientable, want.spec != "moebius");
  for (const char* words : {"its walls", "a boundary of "}) {
    EXPECT_NE(certificate.verdict.find(words), std::string::npos) << certificate.verdict;
  }
  EXPECT_EQ(mesh->boundary().size(), want.walls);
  EXPECT_EQ(mesh->edges().size(), want.edge_faces);
  EXPECT_EQ(Count(mesh->corners()), want.corners);
  EXPECT_EQ(All(mesh->boundary()), Rim(mesh->simplices));
  // What the faces say is so of the points, and nothing is beyond a wall.
  const MatrixXd clearances = domain->Clearances(mesh->points);
  EXPECT_GT(clearances.minCoeff(), -1e-9);
  for (int dimension = 0; dimension < mesh->dimension(); ++dimension) {
    for (const Face& face : mesh->faces(dimension)) {
      for (const std::uint32_t vertex : face.simplices.reshaped()) {
        for (const int wall : face.walls) EXPECT_LT(std::abs(clearances(wall, vertex)), 1e-9);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Catalogue, EveryDomain,
                         ::testing::Values(DomainCase{"hemisphere", 0.3, 1, 1, 0, 0},
                                           DomainCase{"hemisphere:3", 0.5, 1, 1, 0, 0},
                                           DomainCase{"half-torus:1:0.4", 0.16, 0, 1, 0, 0},
                                           DomainCase{"moebius", 0.25, 0, 1, 0, 0},
                                           DomainCase{"ball", 0.5, 1, 1, 0, 0},
                                           DomainCase{"cube", 0.5, 1, 6, 12, 8},
                                           DomainCase{"cube:2", 0.3, 1, 4, 0, 4},
                                           DomainCase{"cylinder", 0.3, 1, 3, 2, 0},
                                           DomainCase{"drilled-cube:0.5", 0.25, 0, 7, 14, 8},
                                           DomainCase{"shell:0.4", 0.2, 2, 2, 0, 0},
                                           DomainCase{"solid-torus:1:0.4", 0.2, 0, 1, 0, 0}));

class WallsFromCpp : public Live {};

// All that it has: corners that nobody told of, by the walls' own values.
TEST_F(WallsFromCpp, GyroidInABoxHasItsCorners) {
  const auto domain = oracles::MakeDomain("gyroid-box").value();
  const Expected<Mesh> mesh = MeshManifold(*domain, At(0.25));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.text;
  EXPECT_EQ(Euler(mesh->simplices), mesh->report.certificate.euler_characteristic);
  EXPECT_EQ(All(mesh->boundary()), Rim(mesh->simplices));
  EXPECT_GT(Count(mesh->corners()), 2u);
}

TEST_F(WallsFromCpp, ClippingTwiceIsClippingByAll) {
  const auto sphere = [] {
    return std::make_shared<Solid>(
        Box(-VectorXd::Ones(2), VectorXd::Ones(2)),
        BoundingBox{VectorXd::Constant(2, -1.3), VectorXd::Constant(2, 1.3)});
  };
  Clipped twice(std::make_shared<Clipped>(sphere(), std::vector{Ball(VectorXd::Zero(2), 1.2)}),
                {HalfSpace(VectorXd::Unit(2, 0), 0.1)});
  EXPECT_EQ(twice.walls(), 6);
  const VectorXd x = (VectorXd(2) << 0.5, 0).finished();
  const MatrixXd clearances = twice.Clearances(x);
  EXPECT_NEAR(clearances(4, 0), 1.44 - 0.25, 1e-12);
  EXPECT_NEAR(clearances(5, 0), 0.4, 1e-12);
  const Expected<Mesh> mesh = MeshManifold(twice, At(0.2));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.text;
  EXPECT_EQ(Count(mesh->corners()), 6u);
}

// Differences instead of gradients: the same domain.
TEST_F(WallsFromCpp, GradientsAreNotNeeded) {
  const BoundingBox around{VectorXd::Constant(3, -1.3), VectorXd::Constant(3, 1.3)};
  oracles::Wall wall = Ball(VectorXd::Zero(3), 1);
  Solid exact({wall}, around);
  wall.gradient = {};
  Solid differences({wall}, around);
  const MatrixXd x = MatrixXd::Random(3, 20);
  EXPECT_LT((exact.FacePoint(x, {0}).points - differences.FacePoint(x, {0}).points).norm(), 1e-8);
  const MatrixXd on = exact.FacePoint(x, {0}).points;
  EXPECT_LT((exact.Conormals(on, {0}) - on).norm(), 1e-9);
  EXPECT_LT((differences.Conormals(on, {0}) - on).norm(), 1e-7);
}

TEST_F(WallsFromCpp, DownloadsKeepTheWalls) {
  const auto domain = oracles::MakeDomain("half-torus").value();
  MeshOptions options = At(0.2);
  const Expected<std::string> name = DeclareMesh(*domain, options);
  ASSERT_TRUE(name.has_value()) << name.error().message;
  ServeOptions serve;
  serve.connection.server = Server();
  ASSERT_TRUE(ServeMesh(*domain, *name, serve).has_value());
  DownloadOptions download;
  download.connection.server = Server();
  download.unfinished = Unfinished::kWait;
  const Expected<Mesh> fetched = DownloadMesh(*name, download);
  ASSERT_TRUE(fetched.has_value()) << fetched.error().message;
  const Expected<Mesh> watched = MeshManifold(*domain, options);
  ASSERT_TRUE(watched.has_value());
  EXPECT_TRUE(AreIdentical(*fetched, *watched));
  EXPECT_FALSE(fetched->walls.empty());
  EXPECT_EQ(fetched->walls, watched->walls);
}

TEST_F(WallsFromCpp, WorkersOfOtherWallsAreRefused) {
  const std::shared_ptr<Oracle> sphere = Make("sphere:2");
  Clipped one(sphere, {HalfSpace(VectorXd::Unit(3, 2))});
  const Expected<std::string> name = DeclareMesh(one, At(0.3));
  ASSERT_TRUE(name.has_value()) << name.error().message;
  ServeOptions serve;
  serve.connection.server = Server();
  const auto served = ServeMesh(*sphere, *name, serve);
  ASSERT_FALSE(served.has_value());
  EXPECT_NE(served.error().message.find("1 walls"), std::string::npos) << served.error().message;
}

TEST(Walls, BadDeclarationsAreRefused) {
  const auto refusal = [](const auto& make) -> std::string {
    try {
      make();
    } catch (const std::invalid_argument& failure) {
      return failure.what();
    }
    return "none";
  };
  const std::shared_ptr<Oracle> sphere = MakeManifold("sphere:2").value();
  const VectorXd one = VectorXd::Ones(3);
  EXPECT_NE(refusal([&] { Clipped(sphere, {}); }).find("0 walls"), std::string::npos);
  EXPECT_NE(refusal([&] { Clipped(nullptr, {HalfSpace(one)}); }).find("no oracle"),
            std::string::npos);
  EXPECT_NE(refusal([&] { Clipped(sphere, {oracles::Wall{}}); }).find("functions"),
            std::string::npos);
  EXPECT_NE(refusal([&] { Box(one, one); }).find("lower one first"), std::string::npos);
  EXPECT_NE(refusal([&] { Ball(one, 0); }).find("positive radius"), std::string::npos);
  EXPECT_NE(refusal([&] { HalfSpace(0 * one); }).find("normal"), std::string::npos);
  EXPECT_NE(refusal([&] {
              oracles::Transformed(std::make_shared<Clipped>(sphere, std::vector{HalfSpace(one)}),
                                   {});
            }).find("clip it instead"),
            std::string::npos);
  const auto why = [](const std::string& spec) { return oracles::MakeDomain(spec).error(); };
  EXPECT_NE(why("hemisphere:1.5").message.find("whole number"), std::string::npos);
  EXPECT_NE(why("cube:3:3").message.find("at most 1"), std::string::npos);
  EXPECT_EQ(why("torus").reason, "UNKNOWN_NAME");
}

}  // namespace
}  // namespace stellate::testing
