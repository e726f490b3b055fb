// Watching and serving at once: resuming, merging, slow readers, cancelling.

#include <array>
#include <future>
#include <set>

#include "tests/server/support/live_server.h"
#include "tests/server/support/raw_http2.h"

namespace stellate::server::testing {
namespace {

using grpc::StatusCode;

// A client's copy of a mesh of triangles.
struct Copy {
  std::uint64_t revision = 0;
  std::size_t vertices = 0;
  std::set<std::array<std::uint32_t, 3>> triangles;
  int completed = 0;

  void Apply(const v1::DeltaChunk& chunk) {
    const auto rows = [](const v1::IndexArray& array) {
      std::vector<std::array<std::uint32_t, 3>> out(array.data().size() / 12);
      if (!out.empty()) std::memcpy(out.data(), array.data().data(), array.data().size());
      return out;
    };
    EXPECT_EQ(chunk.delta().points().data().size(), chunk.delta().points().shape(0) * 24u);
    if (chunk.delta().points().shape(0) > 0) {
      EXPECT_EQ(chunk.delta().first_vertex(), vertices);
    }
    vertices += chunk.delta().points().shape(0);
    for (const auto& row : rows(chunk.delta().removed())) EXPECT_EQ(triangles.erase(row), 1u);
    for (const auto& row : rows(chunk.delta().added())) EXPECT_TRUE(triangles.insert(row).second);
    if (!chunk.complete()) return;
    EXPECT_GT(chunk.delta().revision(), revision);
    revision = chunk.delta().revision();
    ++completed;
  }
};

class LiveStreamsTest : public LiveServer {
 protected:
  // Reads the changes after `copy` to the end, or until it has made `changes` steps.
  v1::Mesh Follow(const std::string& name, Copy* copy, int changes = -1) {
    grpc::ClientContext context;
    v1::WatchMeshRequest request;
    request.set_name(name);
    request.set_from_revision(copy->revision);
    const auto reader = stub_->WatchMesh(&context, request);
    v1::WatchMeshResponse event;
    v1::Mesh final;
    while (reader->Read(&event)) {
      if (event.has_delta()) copy->Apply(event.delta());
      if (event.has_final()) final = event.final();
      if (changes >= 0 && copy->completed >= changes) {
        context.TryCancel();
        break;
      }
    }
    const grpc::Status status = reader->Finish();
    EXPECT_EQ(status.ok(), changes < 0) << status.error_message();
    return final;
  }

  static void ExpectWhole(const Copy& copy, const v1::Mesh& final) {
    EXPECT_EQ(copy.revision, final.revision());
    EXPECT_EQ(copy.vertices, final.report().counts().vertices());
    EXPECT_EQ(copy.triangles.size(), final.report().counts().simplices());
  }
};

TEST_F(LiveStreamsTest, TheMeshGrowsBeforeItsWatcherAndIsCertified) {
  Start();
  const std::string name = CreateSphere(0.1);
  Copy copy;
  auto watching = std::async(std::launch::async, [&] { return Follow(name, &copy); });
  RawWorker worker(stub_.get(), name);
  const v1::Mesh final = watching.get();
  EXPECT_EQ(final.state(), v1::MESH_STATE_SUCCEEDED);
  EXPECT_TRUE(final.report().certificate().certified());
  EXPECT_EQ(final.report().certificate().euler_characteristic(), 2);
  EXPECT_GT(copy.vertices, 300u);
  ExpectWhole(copy, final);
  EXPECT_TRUE(worker.Wait().ok());
  EXPECT_EQ(worker.over(), "MESH_STATE_SUCCEEDED");
}

TEST_F(LiveStreamsTest, AMeshHasItsPastAndItsWorkersWhenAsked) {
  Start();
  const std::string name = CreateSphere(0.1);
  const auto look = [&](bool workers, std::optional<std::uint64_t> after) {
    v1::GetMeshRequest request;
    request.set_name(name);
    request.set_worker_stats(workers);
    if (after) request.set_past_progress_after(*after);
    grpc::ClientContext context;
    v1::Mesh mesh;
    EXPECT_TRUE(stub_->GetMesh(&context, request, &mesh).ok());
    return mesh;
  };
  {
    RawWorker silent(stub_.get(), name, [](const auto&) { return std::nullopt; });
    v1::Mesh mesh;
    while ((mesh = look(true, {})).worker_stats_size() == 0) std::this_thread::yield();
    EXPECT_EQ(mesh.worker_stats(0).display_name().substr(0, 8), "test at ");
    EXPECT_EQ(mesh.worker_stats(0).queries(), 0u);
  }
  Copy copy;
  RawWorker worker(stub_.get(), name);
  const v1::Mesh final = Follow(name, &copy);
  EXPECT_EQ(look(false, {}).past_progress_size(), 0);
  EXPECT_EQ(look(true, {}).worker_stats_size(), 0) << "nobody serves it any more";
  const v1::Mesh whole = look(false, 0);
  ASSERT_EQ(static_cast<std::uint64_t>(whole.past_progress_size()), final.revision());
  std::uint64_t broken = 0;
  for (int i = 0; i < whole.past_progress_size(); ++i) {
    EXPECT_EQ(whole.past_progress(i).revision(), i + 1u);
    broken += whole.past_progress(i).progress().bad_size();
  }
  EXPECT_GT(broken, 0u) << "rule R1 made the mesh";
  EXPECT_EQ(whole.past_progress().rbegin()->progress().vertices(), copy.vertices);
  EXPECT_EQ(look(false, final.revision() - 2).past_progress_size(), 2);
}

TEST_F(LiveStreamsTest, AWatcherResumesFromARevision) {
  Start();
  const std::string name = CreateSphere(0.1);
  Copy copy;
  auto first = std::async(std::launch::async, [&] { Follow(name, &copy, 2); });
  RawWorker worker(stub_.get(), name);
  first.get();
  ASSERT_GT(copy.revision, 0u);
  const v1::Mesh final = Follow(name, &copy);
  ExpectWhole(copy, final);

  Copy late;  // all of it, after the end
  Follow(name, &late);
  ExpectWhole(late, final);
  EXPECT_EQ(late.completed, 1) << "rounds come merged";
  EXPECT_EQ(late.triangles, copy.triangles);
}

TEST_F(LiveStreamsTest, ARevisionOfTheFutureIsOutOfRange) {
  Start();
  const std::string name = CreateSphere();
  grpc::ClientContext context;
  v1::WatchMeshRequest request;
  request.set_name(name);
  request.set_from_revision(1000);
  const auto reader = stub_->WatchMesh(&context, request);
  v1::WatchMeshResponse event;
  EXPECT_FALSE(reader->Read(&event));
  const grpc::Status status = reader->Finish();
  EXPECT_EQ(status.error_code(), StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(ReasonIn(status), "REVISION_TOO_NEW");
}

// It never reads; the mesh, its worker and another watcher do not notice. What it reads in the
// end, merged, is the whole mesh.
TEST_F(LiveStreamsTest, ASlowWatcherHoldsUpNobodyAndMissesNothing) {
  Start();
  const std::string name = CreateSphere(0.03);
  const auto slow_stub = NewStub();
  grpc::ClientContext context;
  v1::WatchMeshRequest request;
  request.set_name(name);
  const auto slow = slow_stub->WatchMesh(&context, request);

  Copy quick;
  auto watching = std::async(std::launch::async, [&] { return Follow(name, &quick); });
  RawWorker worker(stub_.get(), name);
  const v1::Mesh final = watching.get();
  EXPECT_EQ(final.state(), v1::MESH_STATE_SUCCEEDED);

  Copy copy;
  v1::WatchMeshResponse event;
  while (slow->Read(&event)) {
    if (event.has_delta()) copy.Apply(event.delta());
  }
  EXPECT_TRUE(slow->Finish().ok());
  ExpectWhole(copy, final);
  EXPECT_EQ(copy.triangles, quick.triangles);
}

// It takes in no more than HTTP/2 sends unasked, and the place of another only for a time.
TEST_F(LiveStreamsTest, AWatcherThatNeverReadsIsGivenUp) {
  Config config;
  config.unread_seconds = 0.1;
  config.keepalive_seconds = 3600;  // else it were given up because it answers no ping
  StartTcp(config);
  const std::string name = CreateSphere(0.03);
  v1::WatchMeshRequest request;
  request.set_name(name);
  RawHttp2 silent(port());
  ASSERT_TRUE(silent.Request("WatchMesh", request.SerializeAsString()));
  while (Get(name).watchers() == 0) std::this_thread::yield();
  RawWorker worker(stub_.get(), name);
  EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
  while (Get(name).watchers() > 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));  // the test's limit ends it
  }
}

TEST_F(LiveStreamsTest, AnIdleMeshStillReportsProgress) {
  Start();
  const std::string name = CreateSphere();
  grpc::ClientContext context;
  v1::WatchMeshRequest request;
  request.set_name(name);
  const auto reader = stub_->WatchMesh(&context, request);
  v1::WatchMeshResponse event;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(reader->Read(&event));
    EXPECT_TRUE(event.has_progress());
  }
}

// More streams wait than gRPC has threads; were one of them to hold a thread, nothing would move.
TEST_F(LiveStreamsTest, WaitingStreamsHoldNoThread) {
  Start();
  std::vector<std::string> names;
  std::vector<std::unique_ptr<RawWorker>> silent;
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::WatchMeshResponse>>> readers;
  for (int i = 0; i < 20; ++i) {
    names.push_back(CreateSphere());
    silent.push_back(std::make_unique<RawWorker>(
        stub_.get(), names.back(),
        [](const v1::QueryChunk&) -> std::optional<v1::ServeOracleRequest> { return {}; }));
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    v1::WatchMeshRequest request;
    request.set_name(names.back());
    readers.push_back(stub_->WatchMesh(contexts.back().get(), request));
  }
  for (const auto& worker : silent) {
    while (worker->chunks() == 0) std::this_thread::yield();
  }
  const std::string name = CreateSphere();
  RawWorker worker(stub_.get(), name);
  EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
  for (const std::string& waiting : names) EXPECT_EQ(Get(waiting).state(), v1::MESH_STATE_RUNNING);
  for (const auto& context : contexts) context->TryCancel();
  v1::WatchMeshResponse event;
  for (const auto& reader : readers) {
    while (reader->Read(&event)) {
    }
  }
}

TEST_F(LiveStreamsTest, ClientsThatVanishAreForgotten) {
  Start();
  const std::string name = CreateSphere();
  {
    RawWorker worker(stub_.get(), name,
                     [](const v1::QueryChunk&) { return std::optional<v1::ServeOracleRequest>(); });
    grpc::ClientContext context;
    v1::WatchMeshRequest request;
    request.set_name(name);
    const auto reader = stub_->WatchMesh(&context, request);
    v1::WatchMeshResponse event;
    ASSERT_TRUE(reader->Read(&event));
    while (worker.chunks() == 0) std::this_thread::yield();
    EXPECT_EQ(Get(name).workers(), 1u);
    EXPECT_EQ(Get(name).watchers(), 1u);
    context.TryCancel();
    while (reader->Read(&event)) {
    }
  }
  for (v1::Mesh mesh = Get(name); mesh.workers() + mesh.watchers() > 0; mesh = Get(name)) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));  // the test's limit ends it
  }
  EXPECT_EQ(Get(name).state(), v1::MESH_STATE_WAITING);
}

// Of watchers that read nothing, one owner, or all clients that are not told apart, may have so
// many as fit an eighth of the memory.
TEST_F(LiveStreamsTest, WatchersThatReadNothingAreCountedInMemory) {
  Config config;
  config.max_memory_bytes = std::uint64_t{64} << 20;
  config.max_watchers = 1000;
  Start(config);
  const std::string name = CreateSphere();
  v1::WatchMeshRequest request;
  request.set_name(name);
  struct Watcher {
    grpc::ClientContext context;
    std::unique_ptr<grpc::ClientReader<v1::WatchMeshResponse>> reader;
    ~Watcher() { context.TryCancel(); }
  };
  std::vector<std::unique_ptr<Watcher>> silent;
  grpc::Status refused;
  while (refused.ok() && silent.size() < config.max_watchers) {
    auto watcher = std::make_unique<Watcher>();
    watcher->reader = stub_->WatchMesh(&watcher->context, request);
    v1::WatchMeshResponse first;
    if (watcher->reader->Read(&first)) {  // where it stands now
      silent.push_back(std::move(watcher));
    } else {
      refused = watcher->reader->Finish();
    }
  }
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(ReasonIn(refused), "LIMIT_EXCEEDED");
  EXPECT_NE(refused.error_message().find("max-memory-bytes"), std::string::npos)
      << refused.error_message();
  const std::uint64_t each = EstimateStreamBytes(SphereSpec(0.3), PartBytes(config));
  EXPECT_EQ(silent.size(), config.max_memory_bytes / 8 / each);
  EXPECT_GT(silent.size(), 8u) << "or nobody could follow a mesh";
  silent.clear();
  v1::WatchMeshResponse event;
  bool watched = false;
  while (!watched) {  // once the server has heard that they are gone
    grpc::ClientContext context;
    watched = stub_->WatchMesh(&context, request)->Read(&event);
    context.TryCancel();
  }
}

TEST_F(LiveStreamsTest, DeletingAMeshEndsItsStreams) {
  Start();
  const std::string name = CreateSphere();
  RawWorker worker(stub_.get(), name,
                   [](const v1::QueryChunk&) { return std::optional<v1::ServeOracleRequest>(); });
  auto watching = std::async(std::launch::async, [&] { return WatchToEnd(name); });
  while (Get(name).watchers() == 0 || worker.chunks() == 0) std::this_thread::yield();
  grpc::ClientContext context;
  v1::DeleteMeshRequest request;
  request.set_name(name);
  google::protobuf::Empty empty;
  ASSERT_TRUE(stub_->DeleteMesh(&context, request, &empty).ok());
  EXPECT_EQ(watching.get().state(), v1::MESH_STATE_CANCELLED);
  EXPECT_TRUE(worker.Wait().ok());
  EXPECT_EQ(worker.over(), "MESH_STATE_CANCELLED");
}

}  // namespace
}  // namespace stellate::server::testing
