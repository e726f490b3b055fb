// A client's deadline ends its call, and leaves nothing behind.

#include "tests/server/support/live_server.h"

namespace stellate::server::testing {
namespace {

using grpc::StatusCode;
using namespace std::chrono_literals;

class LiveDeadlinesTest : public LiveServer {
 protected:
  LiveDeadlinesTest() { context_.set_deadline(std::chrono::system_clock::now() + 300ms); }

  // Nobody is at the mesh any more, and it can still be made.
  void ExpectForgottenAndSound(const std::string& name) {
    for (v1::Mesh mesh = Get(name); mesh.workers() + mesh.watchers() > 0; mesh = Get(name)) {
      std::this_thread::sleep_for(5ms);  // the test's limit ends it
    }
    EXPECT_EQ(Get(name).state(), v1::MESH_STATE_WAITING);
    RawWorker worker(stub_.get(), name);
    EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
  }

  grpc::ClientContext context_;
};

TEST_F(LiveDeadlinesTest, AWatchEndsAtItsDeadline) {
  Start();
  const std::string name = CreateSphere();
  v1::WatchMeshRequest request;
  request.set_name(name);
  const auto reader = stub_->WatchMesh(&context_, request);
  v1::WatchMeshResponse event;
  while (reader->Read(&event)) EXPECT_TRUE(event.has_progress());
  EXPECT_EQ(reader->Finish().error_code(), StatusCode::DEADLINE_EXCEEDED);
  ExpectForgottenAndSound(name);
}

// The chunk that it leaves unanswered goes to another.
TEST_F(LiveDeadlinesTest, AWorkerEndsAtItsDeadline) {
  Start();
  const std::string name = CreateSphere();
  const auto stream = stub_->ServeOracle(&context_);
  v1::ServeOracleRequest hello;
  hello.mutable_hello()->set_mesh(name);
  stream->Write(hello);
  v1::ServeOracleResponse response;
  while (stream->Read(&response)) EXPECT_FALSE(response.has_over());
  EXPECT_EQ(stream->Finish().error_code(), StatusCode::DEADLINE_EXCEEDED);
  ExpectForgottenAndSound(name);
}

TEST_F(LiveDeadlinesTest, WatchersThatComeAndGoLeaveNothing) {
  Config config;
  config.max_watchers = 1000;  // those that go may still be there when the next comes
  Start(config);
  const std::string name = CreateSphere();
  for (int i = 0; i < 200; ++i) {
    grpc::ClientContext context;
    v1::WatchMeshRequest request;
    request.set_name(name);
    const auto reader = stub_->WatchMesh(&context, request);
    v1::WatchMeshResponse event;
    ASSERT_TRUE(reader->Read(&event));
    context.TryCancel();
    while (reader->Read(&event)) {
    }
    EXPECT_EQ(reader->Finish().error_code(), StatusCode::CANCELLED);
  }
  ExpectForgottenAndSound(name);
}

}  // namespace
}  // namespace stellate::server::testing
