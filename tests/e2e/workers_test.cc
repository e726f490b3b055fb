// Several workers, a program that joins a mesh by its name, what an oracle wants at once,
// cancelling. Workers that leave, are silent or busy: python/test_service.py, test_failures.py,
// live_failures_test.cc.
#include <algorithm>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "live.h"
#include "stellate/download.h"
#include "stellate/serve.h"
#include "support/mesh_judge.h"
#include "support/spoiled_oracle.h"

namespace stellate::testing {
namespace {

class Workers : public Live {
 protected:
  // A mesh that nobody serves yet.
  static std::string Declared(Oracle& oracle, double epsilon) {
    const Expected<std::string> name = DeclareMesh(oracle, At(epsilon));
    EXPECT_TRUE(name.has_value()) << name.error().message;
    return *name;
  }
};

TEST_F(Workers, OneAndFourMakeTheSameMesh) {
  for (const auto& [spec, epsilon] : std::vector<std::pair<std::string, double>>{
           {"torus:1:0.4", 0.06}, {"so3", 0.56}, {"torus-knot:2:3", 0.1}}) {
    const auto manifold = Make(spec);
    MeshOptions options = At(epsilon);
    const Expected<Mesh> one = MeshManifold(*manifold, options);
    options.workers = 4;
    const Expected<Mesh> four = MeshManifold(*manifold, options);
    ASSERT_TRUE(one.has_value() && four.has_value()) << spec;
    EXPECT_TRUE(AreIdentical(*one, *four)) << spec;
    options.random_seed = 2;
    const Expected<Mesh> other = MeshManifold(*manifold, options);
    ASSERT_TRUE(other.has_value());
    EXPECT_FALSE(AreIdentical(*one, *other)) << "the random seed changes nothing";
  }
}

TEST_F(Workers, AProgramJoinsAMeshByItsName) {
  const auto torus = Make("torus:1:0.4");
  const Expected<Mesh> undisturbed = MeshManifold(*torus, At(0.1));
  ASSERT_TRUE(undisturbed.has_value());
  const std::string name = Declared(*torus, 0.1);
  ServeOptions options;
  options.connection.server = Server();
  options.max_chunk = 100;
  Eigen::Index most = 0;
  SpoiledOracle counting(*torus);
  counting.on_closest = [&most](const Eigen::MatrixXd& x, Answer&) {
    most = std::max(most, x.cols());
  };
  const Expected<MeshState> state = ServeMesh(counting, name, options);
  ASSERT_TRUE(state.has_value()) << state.error().message;
  EXPECT_EQ(*state, MeshState::kSucceeded);
  EXPECT_GT(most, 1);
  EXPECT_LE(most, 100);
  DownloadOptions download;
  download.connection.server = Server();
  const Expected<Mesh> mesh = DownloadMesh(name, download);
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(AreIdentical(*undisturbed, *mesh));
  // A batch job that comes when all is done is a success.
  const Expected<MeshState> late = ServeMesh(*torus, name, options);
  ASSERT_TRUE(late.has_value()) << late.error().message;
  EXPECT_EQ(*late, MeshState::kSucceeded);
}

TEST_F(Workers, WhoDoesNotSuitAMeshLeavesItAlone) {
  const auto torus = Make("torus:1:0.4"), circle = Make("sphere:1"), cube = Make("tanglecube");
  const std::string name = Declared(*torus, 0.1);
  ServeOptions options;
  options.connection.server = Server();
  const auto refused = [&](Oracle& oracle, const std::string& mesh, const char* words,
                           const char* reason = "INVALID_ARGUMENT") {
    const Expected<MeshState> state = ServeMesh(oracle, mesh, options);
    ASSERT_FALSE(state.has_value());
    EXPECT_EQ(state.error().reason, reason);
    EXPECT_EQ(state.error().code, ErrorCode::kRefused);
    EXPECT_NE(state.error().message.find(words), std::string::npos) << state.error().message;
  };
  refused(*circle, name, "dimension 2 in R^3");
  refused(*cube, name, "local_size, which this oracle lacks");
  refused(*torus, "meshes/00000000000000000000000000000000", "meshes/0000", "MESH_NOT_FOUND");
  options.max_chunk = 0;
  refused(*torus, name, "max_chunk");
  options.max_chunk.reset();
  // Nor does one that is told to go: the mesh waits for the next.
  std::stop_source stop;
  options.stop = stop.get_token();
  SpoiledOracle leaving(*torus);
  leaving.on_closest = [&stop](const Eigen::MatrixXd&, Answer&) { stop.request_stop(); };
  const Expected<MeshState> left = ServeMesh(leaving, name, options);
  ASSERT_FALSE(left.has_value());
  EXPECT_EQ(left.error().code, ErrorCode::kStopped);
  options.stop = {};
  const Expected<MeshState> state = ServeMesh(*torus, name, options);
  ASSERT_TRUE(state.has_value()) << state.error().message;
  EXPECT_EQ(*state, MeshState::kSucceeded);
}

TEST_F(Workers, NoMoreAtOnceThanTheOracleWants) {
  const auto torus = Make("torus:1:0.4");
  SpoiledOracle narrow(*torus);
  Eigen::Index most = 0;
  narrow.on_closest = [&most](const Eigen::MatrixXd& x, Answer&) {
    most = std::max(most, x.cols());
  };
  MeshOptions options = At(0.2);
  options.max_chunk = 7;
  ASSERT_TRUE(MeshManifold(narrow, options).has_value());
  EXPECT_EQ(most, 7);
  options.max_chunk = 0;
  EXPECT_FALSE(MeshManifold(narrow, options).has_value());
}

TEST_F(Workers, StopCancelsAndReturnsWhatIsThere) {
  const auto torus = Make("torus:1:0.4");
  std::stop_source source;
  MeshOptions options = At(0.01);  // far more than is waited for
  options.stop = source.get_token();
  options.on_progress = [&](const Progress& progress) {
    if (progress.vertices > 100) source.request_stop();
  };
  const Expected<Mesh> mesh = MeshManifold(*torus, options);
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_EQ(mesh->report.termination, Termination::kCancelled);
  EXPECT_FALSE(mesh->report.certified());
  EXPECT_GT(mesh->points.cols(), 100);
}

TEST_F(Workers, TenThousandVerticesInAtMostFortyFiveRoundTrips) {
  const auto torus = Make("torus:1:0.4");
  const Expected<Mesh> mesh = MeshManifold(*torus, At(0.027));
  ASSERT_TRUE(mesh.has_value());
  EXPECT_TRUE(IsFaithful(*mesh, *torus, 0.027));
  EXPECT_GE(mesh->report.counts.vertices, 9'000u);
  EXPECT_LE(mesh->report.counts.rounds, 45u) << mesh->report.text;
  EXPECT_LE(mesh->report.counts.queries, 2 * mesh->report.counts.vertices) << mesh->report.text;
}

TEST(EmbeddedDefault, NeedsNoServerAndLeavesNoneBehind) {
  const auto circle = MakeManifold("circle:3").value();
  MeshOptions options;
  options.epsilon = 0.3;
  const Expected<Mesh> mesh = MeshManifold(*circle, options);
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(IsFaithful(*mesh, *circle, 0.3));
}

TEST(EmbeddedDefault, StopsItsServer) {
  std::string address;
  {
    const auto server = client::EmbeddedServer::Start();
    ASSERT_TRUE(server.has_value()) << server.error().message;
    address = (*server)->address();
    EXPECT_TRUE(CheckHealth({address}).has_value());
  }
  EXPECT_FALSE(CheckHealth({address}).has_value());
}

}  // namespace
}  // namespace stellate::testing
