// Requests to a live server, good and bad, through raw stubs.

#include <filesystem>
#include <limits>

#include "server/base/version.h"
#include "tests/server/support/certificates.h"
#include "tests/server/support/live_server.h"

namespace stellate::server::testing {
namespace {

using grpc::StatusCode;

class LiveRequestsTest : public LiveServer {
 protected:
  void ExpectRefused(const char* field, StatusCode code,
                     const std::function<void(v1::MeshSpec*)>& change) {
    v1::MeshSpec spec = SpecOfSphere();
    change(&spec);
    v1::Mesh mesh;
    const grpc::Status status = Create(spec, &mesh);
    EXPECT_EQ(status.error_code(), code) << field << ": " << status.error_message();
    EXPECT_EQ(FieldIn(status), std::string("spec.") + field) << status.error_message();
    EXPECT_EQ(ReasonIn(status),
              code == StatusCode::INVALID_ARGUMENT ? "INVALID_ARGUMENT" : "LIMIT_EXCEEDED");
  }
};

TEST_F(LiveRequestsTest, BadSpecificationsAreRefusedOneByOne) {
  Config config;
  config.max_ambient_dimension = 50;
  Start(config);
  const std::string other = CreateSphere();
  using Spec = v1::MeshSpec;
  const auto invalid = StatusCode::INVALID_ARGUMENT;
  ExpectRefused("dimension", invalid, [](Spec* s) { s->set_dimension(0); });
  ExpectRefused("dimension", invalid, [](Spec* s) { s->set_dimension(3); });
  ExpectRefused("ambient_dimension", StatusCode::RESOURCE_EXHAUSTED,
                [](Spec* s) { s->set_ambient_dimension(51); });
  for (const double epsilon : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                               std::numeric_limits<double>::infinity()}) {
    ExpectRefused("epsilon", invalid, [epsilon](Spec* s) { s->set_epsilon(epsilon); });
  }
  ExpectRefused("bounding_box", invalid, [](Spec* s) {
    s->mutable_bounding_box()->mutable_lower()->Swap(s->mutable_bounding_box()->mutable_upper());
  });
  ExpectRefused("bounding_box", invalid, [](Spec* s) {
    *s->mutable_bounding_box()->mutable_upper() = s->bounding_box().lower();
  });
  ExpectRefused("bounding_box", invalid, [](Spec* s) { s->clear_bounding_box(); });
  ExpectRefused("label", invalid, [](Spec* s) { s->set_label(std::string(200, 'x')); });
  ExpectRefused("oracle.about", invalid,
                [](Spec* s) { s->mutable_oracle()->set_about(std::string(301, 'x')); });
  ExpectRefused("oracle.about", invalid,
                [](Spec* s) { s->mutable_oracle()->set_about("two\nlines"); });
  // Nothing of it harmed the mesh beside.
  RawWorker worker(stub_.get(), other);
  EXPECT_EQ(WatchToEnd(other).state(), v1::MESH_STATE_SUCCEEDED);
}

TEST_F(LiveRequestsTest, AMeshIsDeclaredOnceUnderItsId) {
  Config config;
  config.data_dir = ::testing::TempDir() + "stellate-ids-" + std::to_string(getpid());
  std::filesystem::remove_all(config.data_dir);
  const std::string id = "0123456789abcdef0123456789abcdef", name = "meshes/" + id;
  v1::MeshSpec spec = SpecOfSphere();
  spec.set_label("mine");
  spec.mutable_limits()->set_worker_wait_seconds(77.1);
  for (int servers = 0; servers < 2; ++servers) {  // the second finds it in the record
    Start(config);
    for (int times = 0; times < 2; ++times) {
      v1::Mesh mesh;
      const grpc::Status status = Create(spec, id, &mesh);
      ASSERT_TRUE(status.ok()) << status.error_message();
      EXPECT_EQ(mesh.name(), name);
    }
    v1::MeshSpec other = spec;
    other.set_epsilon(0.31);
    v1::Mesh mesh;
    const grpc::Status status = Create(other, id, &mesh);
    EXPECT_EQ(status.error_code(), StatusCode::INVALID_ARGUMENT) << status.error_message();
    EXPECT_EQ(FieldIn(status), "mesh_id");
    grpc::ClientContext context;
    v1::ListMeshesResponse all;
    ASSERT_TRUE(stub_->ListMeshes(&context, {}, &all).ok());
    EXPECT_EQ(all.meshes_size(), 1);
    if (servers == 0) server_.reset();
  }
  // What it became is what the client is told.
  RawWorker worker(stub_.get(), name);
  EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
  v1::Mesh mesh;
  ASSERT_TRUE(Create(spec, id, &mesh).ok());
  EXPECT_EQ(mesh.state(), v1::MESH_STATE_SUCCEEDED);
  // A deleted one is declared anew.
  grpc::ClientContext context;
  v1::DeleteMeshRequest remove;
  remove.set_name(name);
  google::protobuf::Empty empty;
  ASSERT_TRUE(stub_->DeleteMesh(&context, remove, &empty).ok());
  ASSERT_TRUE(Create(spec, id, &mesh).ok());
  EXPECT_EQ(mesh.state(), v1::MESH_STATE_WAITING);
  server_.reset();
  std::filesystem::remove_all(config.data_dir);
}

TEST_F(LiveRequestsTest, IdsThatAreNoneAreTold) {
  Start();
  for (const std::string& id :
       {std::string("1"), std::string(31, 'a'), std::string(33, 'a'), std::string(32, 'A'),
        std::string(32, 'g'), std::string(100'000, 'a'), "../" + std::string(29, 'a')}) {
    v1::Mesh mesh;
    const grpc::Status status = Create(SpecOfSphere(), id, &mesh);
    EXPECT_EQ(status.error_code(), StatusCode::INVALID_ARGUMENT) << status.error_message();
    EXPECT_EQ(FieldIn(status), "mesh_id");
    EXPECT_LT(status.error_message().size(), 1000u);
  }
}

TEST_F(LiveRequestsTest, NamesThatAreNoMeshAreTold) {
  Start();
  for (const auto& [name, code, reason] :
       {std::tuple("meshes/x", StatusCode::INVALID_ARGUMENT, "INVALID_ARGUMENT"),
        std::tuple("meshes/00000000000000000000000000000000", StatusCode::NOT_FOUND,
                   "MESH_NOT_FOUND")}) {
    v1::Mesh mesh;
    google::protobuf::Empty empty;
    v1::GetMeshRequest get;
    get.set_name(name);
    v1::CancelMeshRequest cancel;
    cancel.set_name(name);
    v1::DeleteMeshRequest remove;
    remove.set_name(name);
    v1::WatchMeshRequest watch;
    watch.set_name(name);
    grpc::ClientContext contexts[4];
    const auto reader = stub_->WatchMesh(&contexts[3], watch);
    v1::WatchMeshResponse event;
    EXPECT_FALSE(reader->Read(&event));
    const grpc::Status statuses[] = {stub_->GetMesh(&contexts[0], get, &mesh),
                                     stub_->CancelMesh(&contexts[1], cancel, &mesh),
                                     stub_->DeleteMesh(&contexts[2], remove, &empty),
                                     reader->Finish(), RawWorker(stub_.get(), name).Wait()};
    for (const grpc::Status& status : statuses) {
      EXPECT_EQ(status.error_code(), code) << status.error_message();
      EXPECT_EQ(ReasonIn(status), reason);
    }
  }
}

TEST_F(LiveRequestsTest, AMeshIsMadeListedCancelledAndDeleted) {
  Start();
  const std::string a = CreateSphere();
  const std::string b = CreateSphere();
  EXPECT_EQ(Get(a).state(), v1::MESH_STATE_WAITING);
  v1::ListMeshesRequest list;
  list.set_page_size(1);
  v1::ListMeshesResponse first, second;
  grpc::ClientContext contexts[5];
  ASSERT_TRUE(stub_->ListMeshes(&contexts[0], list, &first).ok());
  ASSERT_EQ(first.meshes_size(), 1);
  EXPECT_EQ(first.meshes(0).name(), a);
  list.set_page_token(first.next_page_token());
  ASSERT_TRUE(stub_->ListMeshes(&contexts[1], list, &second).ok());
  ASSERT_EQ(second.meshes_size(), 1);
  EXPECT_EQ(second.meshes(0).name(), b);
  EXPECT_EQ(second.next_page_token(), "");

  v1::CancelMeshRequest cancel;
  cancel.set_name(a);
  v1::Mesh mesh;
  ASSERT_TRUE(stub_->CancelMesh(&contexts[2], cancel, &mesh).ok());
  EXPECT_EQ(mesh.state(), v1::MESH_STATE_CANCELLED);
  const v1::Mesh final = WatchToEnd(a);
  EXPECT_EQ(final.state(), v1::MESH_STATE_CANCELLED);
  EXPECT_EQ(final.report().termination(), v1::TERMINATION_CANCELLED);
  EXPECT_FALSE(final.report().certificate().certified());
  EXPECT_TRUE(final.has_end_time());

  v1::DeleteMeshRequest remove;
  remove.set_name(a);
  google::protobuf::Empty empty;
  ASSERT_TRUE(stub_->DeleteMesh(&contexts[3], remove, &empty).ok());
  EXPECT_EQ(stub_->DeleteMesh(&contexts[4], remove, &empty).error_code(), StatusCode::NOT_FOUND);
  EXPECT_EQ(Get(b).state(), v1::MESH_STATE_WAITING);
}

TEST_F(LiveRequestsTest, MeshesBeyondTheLimitAreRefused) {
  Config config;
  config.max_meshes = 1;
  Start(config);
  CreateSphere();
  v1::Mesh mesh;
  const grpc::Status status = Create(SpecOfSphere(), &mesh);
  EXPECT_EQ(status.error_code(), StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(ReasonIn(status), "LIMIT_EXCEEDED");
  EXPECT_EQ(LimitIn(status), "max-meshes=1 of server");
}

TEST_F(LiveRequestsTest, EachLimitIsNamedWithItsValue) {
  Config config;
  config.max_dimension = 1;
  config.max_ambient_dimension = 50;
  config.max_vertices = 1000;
  config.max_coordinates = 30'000;
  config.max_rounds = 10;
  config.max_wait_seconds = 100;
  Start(config);
  const auto limit_of = [this](const std::function<void(v1::MeshSpec*)>& change) {
    v1::MeshSpec spec = SpecOfSphere();
    change(&spec);
    v1::Mesh mesh;
    const grpc::Status status = Create(spec, &mesh);
    EXPECT_EQ(status.error_code(), StatusCode::RESOURCE_EXHAUSTED) << status.error_message();
    EXPECT_EQ(ReasonIn(status), "LIMIT_EXCEEDED");
    const std::string limit = LimitIn(status);
    EXPECT_NE(status.error_message().find("--" + limit.substr(0, limit.find('='))),
              std::string::npos)
        << status.error_message();
    return limit;
  };
  EXPECT_EQ(limit_of([](v1::MeshSpec*) {}), "max-dimension=1 of mesh");
  const auto limit_of_curve = [&](const std::function<void(v1::MeshSpec*)>& change) {
    return limit_of([&change](v1::MeshSpec* spec) {
      spec->set_dimension(1);
      change(spec);
    });
  };
  EXPECT_EQ(limit_of_curve([](v1::MeshSpec* s) { s->set_ambient_dimension(51); }),
            "max-ambient-dimension=50 of mesh");
  EXPECT_EQ(limit_of_curve([](v1::MeshSpec* s) { s->mutable_limits()->set_max_vertices(1001); }),
            "max-vertices=1000 of mesh");
  EXPECT_EQ(limit_of_curve([](v1::MeshSpec* s) { s->mutable_limits()->set_max_rounds(11); }),
            "max-rounds=10 of mesh");
  EXPECT_EQ(limit_of_curve([](v1::MeshSpec* s) { s->mutable_limits()->set_answer_seconds(101); }),
            "max-wait=100 of mesh");
}

TEST_F(LiveRequestsTest, AVerdictEndsWithWhatTheOracleSaysOfItself) {
  ::testing::internal::CaptureStderr();
  StartLogging(LogLevel::kInfo, LogFormat::kText);
  const ScratchDirectory directory;
  Config config;
  config.data_dir = directory / "data";
  Start(config);
  v1::MeshSpec spec = SpecOfSphere();
  spec.mutable_oracle()->set_about("a sphere, fitted to 12 points");
  v1::Mesh finished, open, cancelled;
  for (v1::Mesh* const mesh : {&finished, &open, &cancelled}) ASSERT_TRUE(Create(spec, mesh).ok());
  EXPECT_EQ(finished.spec().oracle().about(), spec.oracle().about());
  const auto is_told = [](const v1::Mesh& mesh) {
    return mesh.report().certificate().verdict().ends_with(
        ". The oracle says of itself: a sphere, fitted to 12 points.");
  };
  {
    RawWorker worker(stub_.get(), finished.name());
    finished = WatchToEnd(finished.name());
  }
  EXPECT_TRUE(finished.report().certificate().certified());
  EXPECT_TRUE(is_told(finished)) << finished.report().certificate().verdict();
  grpc::ClientContext context;
  v1::CancelMeshRequest cancel;
  cancel.set_name(cancelled.name());
  ASSERT_TRUE(stub_->CancelMesh(&context, cancel, &cancelled).ok());
  cancelled = WatchToEnd(cancelled.name());
  EXPECT_TRUE(is_told(cancelled)) << cancelled.report().certificate().verdict();

  server_.reset();
  Start(config);
  EXPECT_EQ(Get(open.name()).spec().oracle().about(), spec.oracle().about());
  EXPECT_EQ(WatchToEnd(finished.name()).report().certificate().verdict(),
            finished.report().certificate().verdict());
  RawWorker worker(stub_.get(), open.name());
  open = WatchToEnd(open.name());
  EXPECT_EQ(open.report().certificate().verdict(), finished.report().certificate().verdict());

  const std::string silent = CreateSphere();
  RawWorker another(stub_.get(), silent);
  const v1::Certificate plain = WatchToEnd(silent).report().certificate();
  EXPECT_EQ(plain.verdict().find("says of itself"), std::string::npos) << plain.verdict();

  StartLogging(LogLevel::kWarning, LogFormat::kText);
  const std::string log = ::testing::internal::GetCapturedStderr();
  EXPECT_NE(log.find("verdict=\"" + finished.report().certificate().verdict()), std::string::npos)
      << log;
}

TEST_F(LiveRequestsTest, LimitsChangeWithoutARestart) {
  Config config;
  config.max_meshes = 1;
  Start(config);
  const std::string running = CreateSphere();
  v1::Mesh mesh;
  EXPECT_EQ(LimitIn(Create(SpecOfSphere(), &mesh)), "max-meshes=1 of server");

  config = *server_->config();
  config.max_meshes = 2;
  config.max_vertices = 1000;
  config.max_message_bytes *= 2;
  ::testing::internal::CaptureStderr();
  EXPECT_TRUE(server_->Reload(config).ok());
  const std::string log = ::testing::internal::GetCapturedStderr();
  EXPECT_NE(log.find("max-message-bytes was changed: that holds from the next start on"),
            std::string::npos)
      << log;
  EXPECT_EQ(log.find("max-meshes was changed"), std::string::npos) << log;
  v1::ServerInfo info;
  grpc::ClientContext context;
  EXPECT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
  EXPECT_EQ(info.max_meshes(), 2u);
  EXPECT_EQ(info.max_vertices(), 1000u);
  EXPECT_EQ(info.max_message_bytes(), Config{}.max_message_bytes);
  EXPECT_TRUE(Create(SpecOfSphere(), &mesh).ok());
  v1::MeshSpec large = SpecOfSphere();
  large.mutable_limits()->set_max_vertices(1001);
  EXPECT_EQ(LimitIn(Create(large, &mesh)), "max-vertices=1000 of mesh");

  // What makes no sense changes nothing.
  Config wrong = config;
  wrong.max_meshes = 3;
  wrong.metrics_listen = "nowhere";
  const core::Status status = server_->Reload(wrong);
  EXPECT_EQ(status.code, core::StatusCode::kInvalidArgument);
  EXPECT_NE(status.message.find("--metrics-listen"), std::string::npos) << status.message;
  EXPECT_EQ(server_->config()->max_meshes, 2u);

  // A lower limit ends no mesh that runs.
  config.max_meshes = 1;
  EXPECT_TRUE(server_->Reload(config).ok());
  EXPECT_EQ(LimitIn(Create(SpecOfSphere(), &mesh)), "max-meshes=1 of server");
  RawWorker worker(stub_.get(), running);
  EXPECT_EQ(WatchToEnd(running).state(), v1::MESH_STATE_SUCCEEDED);
}

// Not a mesh that ends at once as JOURNAL_FULL.
TEST_F(LiveRequestsTest, WithoutRoomInTheRecordThereIsNoNewMesh) {
  const ScratchDirectory directory;
  Config config;
  config.data_dir = directory / "data";
  config.max_journal_bytes = 500'000;
  config.max_meshes = 1000;
  Start(config);
  v1::MeshSpec spec = SpecOfSphere();
  const std::vector<double> seeds(3 * 3000, 1.0);
  ToProto(seeds.data(), {3000, 3}, spec.mutable_seeds());
  std::vector<std::string> names;
  grpc::Status status;
  while (status.ok()) {
    v1::Mesh mesh;
    status = Create(spec, &mesh);
    if (status.ok()) names.push_back(mesh.name());
  }
  EXPECT_EQ(status.error_code(), StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(ReasonIn(status), "LIMIT_EXCEEDED");
  EXPECT_EQ(LimitIn(status), "max-journal-bytes=500000 of server");
  EXPECT_NE(status.error_message().find("delete meshes"), std::string::npos);
  for (const std::string& name : names) {
    grpc::ClientContext context;
    v1::DeleteMeshRequest request;
    request.set_name(name);
    google::protobuf::Empty empty;
    EXPECT_TRUE(stub_->DeleteMesh(&context, request, &empty).ok());
  }
  v1::Mesh mesh;
  while (!Create(spec, &mesh).ok()) std::this_thread::yield();  // the removal is another thread's
  server_.reset();                                              // before its directory goes
}

TEST_F(LiveRequestsTest, WithoutMemoryLeftThereIsNoNewMesh) {
  Config config;
  config.max_memory_bytes = 1000;
  Start(config);
  v1::Mesh mesh;
  const grpc::Status status = Create(SpecOfSphere(), &mesh);
  EXPECT_EQ(status.error_code(), StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(LimitIn(status), "max-memory-bytes=1000 of server");
}

TEST_F(LiveRequestsTest, AMeshThatOutgrowsTheMemoryFailsAlone) {
  Config config;
  config.max_memory_bytes = 1'200'000;
  Start(config);
  const std::string large = CreateSphere(0.02);
  {
    RawWorker worker(stub_.get(), large);
    const v1::Mesh mesh = WatchToEnd(large);
    EXPECT_EQ(mesh.state(), v1::MESH_STATE_FAILED);
    EXPECT_EQ(mesh.report().failure().reason(), "LIMIT_EXCEEDED");
    EXPECT_NE(mesh.report().failure().message().find("--max-memory-bytes"), std::string::npos);
    EXPECT_TRUE(worker.Wait().ok());
  }
  grpc::ClientContext context;
  v1::DeleteMeshRequest request;
  request.set_name(large);
  google::protobuf::Empty empty;
  ASSERT_TRUE(stub_->DeleteMesh(&context, request, &empty).ok());
  // Soon: what the large one held counts until it has been taken apart.
  for (v1::Mesh mesh; mesh.state() != v1::MESH_STATE_SUCCEEDED;) {
    const grpc::Status status = Create(SpecOfSphere(), &mesh);
    if (!status.ok()) {
      ASSERT_EQ(LimitIn(status), "max-memory-bytes=1200000 of server");
      continue;
    }
    RawWorker worker(stub_.get(), mesh.name());
    mesh = WatchToEnd(mesh.name());
    if (mesh.state() == v1::MESH_STATE_FAILED) {
      ASSERT_EQ(mesh.report().failure().reason(), "LIMIT_EXCEEDED");
    }
  }
}

TEST_F(LiveRequestsTest, AMessageOverTheLimitIsRefusedAndTheServerGoesOn) {
  Start();
  v1::MeshSpec spec = SpecOfSphere();
  spec.mutable_seeds()->mutable_data()->assign(std::size_t{5} << 20, '\0');
  v1::Mesh mesh;
  EXPECT_EQ(Create(spec, &mesh).error_code(), StatusCode::RESOURCE_EXHAUSTED);
  const std::string name = CreateSphere();
  RawWorker huge(stub_.get(), name, [](const v1::QueryChunk& queries) {
    v1::ServeOracleRequest request;
    request.mutable_answers()->set_lease(queries.lease());
    request.mutable_answers()->set_found(std::string(std::size_t{5} << 20, '\1'));
    return std::optional(request);
  });
  EXPECT_FALSE(huge.Wait().ok());
  RawWorker worker(stub_.get(), name);
  EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
}

TEST_F(LiveRequestsTest, ServerInfoStatesTheLimits) {
  Config config;
  config.max_meshes = 3;
  config.max_ambient_dimension = 17;
  Start(config);
  grpc::ClientContext context;
  v1::ServerInfo info;
  ASSERT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
  EXPECT_EQ(info.version(), Version());
  ASSERT_EQ(info.protocols_size(), 1);
  EXPECT_EQ(info.protocols(0), "stellate.v1");
  EXPECT_EQ(info.max_meshes(), 3u);
  EXPECT_EQ(info.max_ambient_dimension(), 17u);
  EXPECT_EQ(info.max_dimension(), static_cast<unsigned>(core::kMaxDimension));
  EXPECT_EQ(info.max_message_bytes(), config.max_message_bytes);
  EXPECT_EQ(info.owner_meshes(), config.owner_meshes);
  EXPECT_EQ(info.max_workers(), config.max_workers);
  EXPECT_EQ(info.max_watchers(), config.max_watchers);
  EXPECT_EQ(info.check_share(), config.check_share);
  EXPECT_GT(info.max_memory_bytes(), 0u) << "a part of the machine's";
  EXPECT_EQ(info.owner_memory_bytes(), info.max_memory_bytes() / 2);
}

}  // namespace
}  // namespace stellate::server::testing
