// Several workers, workers that leave, oracles that never answer, cancelling, progress.
#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "live.h"
#include "run/delta_mesh.h"
#include "run/worker.h"
#include "stellate/serve.h"
#include "stellate/v1/stellate.grpc.pb.h"
#include "support/mesh_judge.h"
#include "support/spoiled_oracle.h"
#include "wire/convert.h"

namespace stellate::testing {
namespace {

class Workers : public Live {
 protected:
  Workers()
      : stub_(v1::Stellate::NewStub(
            grpc::CreateChannel(Server(), grpc::InsecureChannelCredentials()))) {}

  // Creates a mesh without serving it, as MeshManifold would.
  std::string Create(Oracle& oracle, const MeshOptions& options) {
    const auto spec = client::ToSpec(oracle, options);
    EXPECT_TRUE(spec.has_value());
    v1::CreateMeshRequest request;
    *request.mutable_spec() = *spec;
    grpc::ClientContext context;
    v1::Mesh mesh;
    const grpc::Status status = stub_->CreateMesh(&context, request, &mesh);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return mesh.name();
  }

  // Follows a mesh to its end.
  struct Ending {
    v1::Mesh final;
    Mesh mesh;
  };
  Ending Watch(const std::string& name, int k, int d) {
    Ending ending;
    auto builder = client::DeltaMesh::Create(k, d);
    grpc::ClientContext context;
    v1::WatchMeshRequest request;
    request.set_name(name);
    const auto stream = stub_->WatchMesh(&context, request);
    v1::WatchMeshResponse response;
    while (stream->Read(&response)) {
      if (response.has_delta()) {
        EXPECT_TRUE(builder->Absorb(std::move(*response.mutable_delta())).has_value());
      }
      if (response.has_final()) ending.final = response.final();
    }
    EXPECT_TRUE(stream->Finish().ok());
    ending.mesh = *builder->Take();
    return ending;
  }

  // A worker that takes `chunks` chunks, answering all but the last, which it keeps. Leave ends it.
  class Leaver {
   public:
    Leaver(v1::Stellate::Stub& stub, const std::string& mesh, Oracle& oracle, int chunks)
        : stream_(stub.ServeOracle(&context_)) {
      v1::ServeOracleRequest hello;
      hello.mutable_hello()->set_mesh(mesh);
      hello.mutable_hello()->set_worker("leaver");
      EXPECT_TRUE(stream_->Write(hello));
      v1::ServeOracleResponse response;
      while (chunks > 0 && stream_->Read(&response)) {
        if (!response.has_queries()) continue;
        if (--chunks > 0) {
          EXPECT_TRUE(stream_->Write(AnswerTo(response.queries(), oracle)));
        }
      }
      EXPECT_EQ(chunks, 0) << "the mesh was over before the worker could leave";
    }
    void Leave() {
      context_.TryCancel();
      stream_->Finish();
    }

   private:
    static v1::ServeOracleRequest AnswerTo(const v1::QueryChunk& chunk, Oracle& oracle) {
      const std::uint32_t d = static_cast<std::uint32_t>(oracle.ambient_dimension());
      const std::uint32_t k = static_cast<std::uint32_t>(oracle.dimension());
      const Eigen::MatrixXd points = *client::FromArray(chunk.points(), {d});
      const Answer answer =
          chunk.kind() == v1::QUERY_KIND_CLOSEST_POINT
              ? oracle.ClosestPoint(points)
              : oracle.IntersectFlat(points, *client::FromArray(chunk.bases(), {d, k}),
                                     client::FromArray(chunk.radii(), {})->row(0).transpose());
      v1::ServeOracleRequest request;
      v1::AnswerChunk& answers = *request.mutable_answers();
      answers.set_lease(chunk.lease());
      client::ToArray(answer.points, {d}, answers.mutable_points());
      answers.set_found(answer.found.data(), answer.found.size());
      if (chunk.want_tangents()) {
        client::ToArray(oracle.TangentBasis(answer.points), {d, k}, answers.mutable_tangents());
      }
      return request;
    }
    grpc::ClientContext context_;
    std::unique_ptr<grpc::ClientReaderWriter<v1::ServeOracleRequest, v1::ServeOracleResponse>>
        stream_;
  };

  const std::unique_ptr<v1::Stellate::Stub> stub_;
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

TEST_F(Workers, WhoLeavesMidRoundIsReplaced) {
  const auto torus = Make("torus:1:0.4");
  const Expected<Mesh> undisturbed = MeshManifold(*torus, At(0.1));
  ASSERT_TRUE(undisturbed.has_value());
  for (const int chunks : {1, 2, 5}) {
    const std::string name = Create(*torus, At(0.1));
    Leaver leaver(*stub_, name, *torus, chunks);
    leaver.Leave();
    client::Worker steady(*stub_, *torus, name, "steady");
    std::thread serving([&] { steady.Run(); });
    const Ending ending = Watch(name, 2, 3);
    serving.join();
    EXPECT_EQ(ending.final.state(), v1::MESH_STATE_SUCCEEDED) << chunks;
    EXPECT_TRUE(AreIdentical(*undisturbed, ending.mesh)) << chunks;
    EXPECT_FALSE(steady.error().has_value());
  }
}

TEST_F(Workers, AProgramJoinsAMeshByItsName) {
  const auto torus = Make("torus:1:0.4");
  const Expected<Mesh> undisturbed = MeshManifold(*torus, At(0.1));
  ASSERT_TRUE(undisturbed.has_value());
  const std::string name = Create(*torus, At(0.1));
  ServeOptions options;
  options.server = Server();
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
  const Ending ending = Watch(name, 2, 3);
  EXPECT_TRUE(AreIdentical(*undisturbed, ending.mesh));
  // A batch job that comes when all is done is a success.
  const Expected<MeshState> late = ServeMesh(*torus, name, options);
  ASSERT_TRUE(late.has_value()) << late.error().message;
  EXPECT_EQ(*late, MeshState::kSucceeded);
}

TEST_F(Workers, WhoDoesNotSuitAMeshLeavesItAlone) {
  const auto torus = Make("torus:1:0.4"), circle = Make("sphere:1"), cube = Make("tanglecube");
  const std::string name = Create(*torus, At(0.1));
  ServeOptions options;
  options.server = Server();
  const auto refused = [&](Oracle& oracle, const std::string& mesh, const char* words) {
    const Expected<MeshState> state = ServeMesh(oracle, mesh, options);
    ASSERT_FALSE(state.has_value());
    EXPECT_EQ(state.error().code, ErrorCode::kRefused);
    EXPECT_NE(state.error().message.find(words), std::string::npos) << state.error().message;
  };
  refused(*circle, name, "dimension 2 in R^3");
  refused(*cube, name, "local_size, which this oracle lacks");
  refused(*torus, "meshes/00000000000000000000000000000000", "meshes/0000");
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
  EXPECT_EQ(left.error().reason, "CANCELLED");
  options.stop = {};
  const Expected<MeshState> state = ServeMesh(*torus, name, options);
  ASSERT_TRUE(state.has_value()) << state.error().message;
  EXPECT_EQ(*state, MeshState::kSucceeded);
}

TEST_F(Workers, WhoNeverAnswersEndsTheMeshByName) {
  const auto torus = Make("torus:1:0.4");
  MeshOptions options = At(0.1);
  options.answer_seconds = 0.1;
  const std::string name = Create(*torus, options);
  Leaver silent(*stub_, name, *torus, 1);
  const Ending ending = Watch(name, 2, 3);
  EXPECT_EQ(ending.final.state(), v1::MESH_STATE_FAILED);
  EXPECT_EQ(ending.final.report().failure().reason(), "ANSWER_TIMEOUT");
  EXPECT_FALSE(ending.final.report().certificate().certified());
  silent.Leave();
}

// Its first calls take longer than three leases together.
TEST_F(Workers, WhoIsSlowSaysSoAndIsWaitedFor) {
  const auto circle = Make("sphere:1");
  SpoiledOracle slow(*circle);
  int calls = 0;
  slow.on_closest = [&calls](const Eigen::MatrixXd&, Answer&) {
    if (++calls <= 2) std::this_thread::sleep_for(std::chrono::milliseconds(800));
  };
  MeshOptions options = At(0.3);
  options.answer_seconds = 0.2;
  const auto mesh = MeshManifold(slow, options);
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certificate.certified);
}

TEST_F(Workers, WhoSaysItIsBusyForEverEndsTheMeshByName) {
  const auto circle = Make("sphere:1");
  SpoiledOracle hung(*circle);
  std::atomic<bool> over = false;
  hung.on_closest = [&over](const Eigen::MatrixXd&, Answer&) { over.wait(false); };
  MeshOptions options = At(0.3);
  options.answer_seconds = 0.1;
  options.busy_seconds = 0.5;
  const std::string name = Create(hung, options);
  client::Worker worker(*stub_, hung, name, "hung");
  std::thread thread([&worker] { worker.Run(); });
  const Ending ending = Watch(name, 1, 2);
  EXPECT_EQ(ending.final.state(), v1::MESH_STATE_FAILED);
  EXPECT_EQ(ending.final.report().failure().reason(), "ANSWER_TIMEOUT");
  over = true;
  over.notify_all();
  thread.join();
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

TEST_F(Workers, NobodyComingEndsTheMeshByName) {
  const auto torus = Make("torus:1:0.4");
  MeshOptions options = At(0.1);
  options.worker_wait_seconds = 0.1;
  const Ending ending = Watch(Create(*torus, options), 2, 3);
  EXPECT_EQ(ending.final.state(), v1::MESH_STATE_FAILED);
  EXPECT_EQ(ending.final.report().failure().reason(), "NO_WORKER");
}

TEST_F(Workers, ServingAMeshThatIsNotThereFailsClearly) {
  const auto torus = Make("torus:1:0.4");
  v1::DeleteMeshRequest request;
  request.set_name(Create(*torus, At(0.1)));
  grpc::ClientContext context;
  google::protobuf::Empty nothing;
  ASSERT_TRUE(stub_->DeleteMesh(&context, request, &nothing).ok());
  client::Worker lost(*stub_, *torus, request.name(), "lost");
  lost.Run();
  ASSERT_TRUE(lost.error().has_value());
  EXPECT_EQ(lost.error()->reason, "MESH_NOT_FOUND");
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

TEST_F(Workers, BudgetsEndARunWithoutACertificate) {
  const auto torus = Make("torus:1:0.4");
  MeshOptions options = At(0.05);
  options.max_vertices = 300;
  const Expected<Mesh> few = MeshManifold(*torus, options);
  ASSERT_TRUE(few.has_value()) << few.error().message;
  EXPECT_EQ(few->report.termination, Termination::kVertexBudget);
  EXPECT_FALSE(few->report.certified());
  EXPECT_LE(few->points.cols(), 300);
  options = At(0.05);
  options.max_rounds = 3;
  const Expected<Mesh> short_run = MeshManifold(*torus, options);
  ASSERT_TRUE(short_run.has_value()) << short_run.error().message;
  EXPECT_EQ(short_run->report.termination, Termination::kRoundBudget);
  EXPECT_FALSE(short_run->report.certified());
}

TEST_F(Workers, ProgressOnlyGrows) {
  const auto torus = Make("torus:1:0.4");
  std::vector<Progress> seen;
  MeshOptions options = At(0.08);
  options.on_progress = [&](const Progress& progress) { seen.push_back(progress); };
  const Expected<Mesh> mesh = MeshManifold(*torus, options);
  ASSERT_TRUE(mesh.has_value());
  ASSERT_FALSE(seen.empty());
  for (size_t i = 1; i < seen.size(); ++i) {
    EXPECT_GE(seen[i].round, seen[i - 1].round);
    EXPECT_GE(seen[i].vertices, seen[i - 1].vertices);
    EXPECT_GE(seen[i].queries, seen[i - 1].queries);
  }
  EXPECT_LE(seen.back().vertices, mesh->report.counts.vertices);
  for (const Progress& progress : seen) {
    EXPECT_GE(progress.fraction, 0);
    EXPECT_LE(progress.fraction, 1);
  }
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
  const auto circle = MakeManifold("circle:3", nullptr);
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
    EXPECT_TRUE(CheckHealth(address).has_value());
  }
  EXPECT_FALSE(CheckHealth(address).has_value());
}

}  // namespace
}  // namespace stellate::testing
