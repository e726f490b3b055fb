#include "server/server.h"

#include <grpc/grpc.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <fstream>
#include <future>

#include "server/net/health_check.h"
#include "tests/server/support/live_server.h"

namespace stellate::server::testing {
namespace {

using namespace std::chrono_literals;

class ServerTest : public LiveServer {
 protected:
  std::string SocketPath() const { return server_->address().substr(5); }
};

TEST_F(ServerTest, TakesAFreePortAndSaysWhich) {
  Config config;
  config.listen = "127.0.0.1:0";
  const auto a = Server::Start(config);
  const auto b = Server::Start(config);
  ASSERT_TRUE(a);
  ASSERT_TRUE(b);
  EXPECT_NE((*a)->address(), (*b)->address());
  EXPECT_FALSE((*a)->address().ends_with(":0"));
  config.listen = (*a)->address();
  EXPECT_FALSE(Server::Start(config)) << "the port is taken";
  EXPECT_EQ(CheckHealth((*a)->address(), 60s), "");
}

TEST_F(ServerTest, LeavesGrpcsOwnShutdownToTheEndOfTheProcess) {
  Config config;
  config.listen = "127.0.0.1:0";
  ASSERT_TRUE(Server::Start(config));  // and stops it
  EXPECT_NE(grpc_is_initialized(), 0) << "the shutdown now and then waits for ten seconds";
}

TEST_F(ServerTest, AUnixSocketIsItsOwnersAlone) {
  Start();
  struct stat info {};
  ASSERT_EQ(stat(SocketPath().c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600u);
}

TEST_F(ServerTest, ALivingServersSocketIsNotTakenOver) {
  Start();
  Config config;
  config.listen = server_->address();
  const auto second = Server::Start(config);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().message.find("another server"), std::string::npos);
  EXPECT_EQ(CheckHealth(server_->address(), 60s), "");
}

TEST_F(ServerTest, ADirectoryThatTakesNoSocketIsNamed) {
  Config config;
  config.listen = "unix:" + ::testing::TempDir() + "stellate-no-such-directory/socket";
  const auto server = Server::Start(config);
  ASSERT_FALSE(server);
  EXPECT_NE(server.error().message.find("in its directory: No such file"), std::string::npos)
      << server.error().message;
}

TEST_F(ServerTest, AFileThatIsNoSocketIsLeftAlone) {
  Config config;
  const std::string path = ::testing::TempDir() + "stellate-file-" + std::to_string(getpid());
  std::ofstream(path) << "precious";
  config.listen = "unix:" + path;
  EXPECT_FALSE(Server::Start(config));
  std::string words;
  std::ifstream(path) >> words;
  EXPECT_EQ(words, "precious");
  unlink(path.c_str());
}

TEST_F(ServerTest, HealthSaysNoOnceItStops) {
  Start();
  const std::string address = server_->address();
  EXPECT_EQ(CheckHealth(address, 60s), "");
  EXPECT_EQ(CheckHealth(address, 60s, grpc::InsecureChannelCredentials(), "stellate.v1.Stellate"),
            "");
  EXPECT_TRUE(server_->Stop(0s));
  EXPECT_NE(CheckHealth(address, 60s), "");
}

TEST_F(ServerTest, StoppingLetsRunningMeshesEnd) {
  Start();
  const std::string name = CreateSphere();
  std::promise<void> gate;
  const auto open = gate.get_future().share();
  RawWorker worker(stub_.get(), name, [open](const v1::QueryChunk& queries) {
    open.wait();
    return RawWorker::Truly(queries);
  });
  while (worker.chunks() == 0) std::this_thread::yield();
  auto watching = std::async(std::launch::async, [&] { return WatchToEnd(name); });
  while (Get(name).watchers() == 0) std::this_thread::yield();
  std::atomic<bool> draining{false};
  auto stopping = std::async(std::launch::async, [&] {
    return server_->Stop(60s, [&draining] {
      draining = true;
      return false;
    });
  });
  while (!draining) std::this_thread::yield();
  v1::Mesh refused;
  const grpc::Status status = Create(SpecOfSphere(), &refused);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(ReasonIn(status), "SHUTTING_DOWN");
  for (const char* service : {"", "stellate.v1.Stellate"}) {
    const std::string health =
        CheckHealth(server_->address(), 60s, grpc::InsecureChannelCredentials(), service);
    EXPECT_NE(health.find("is not serving"), std::string::npos) << service << ": " << health;
  }
  EXPECT_EQ(CheckHealth(server_->address(), 60s, grpc::InsecureChannelCredentials(), "alive"), "");
  gate.set_value();
  EXPECT_EQ(watching.get().state(), v1::MESH_STATE_SUCCEEDED);
  EXPECT_TRUE(stopping.get());
  EXPECT_TRUE(worker.Wait().ok());
}

// With hours to drain, this ends because nobody serves the mesh.
TEST_F(ServerTest, StoppingDoesNotWaitForAMeshThatNobodyServes) {
  Start();
  const std::string name = CreateSphere();
  {
    RawWorker worker(stub_.get(), name,
                     [](const v1::QueryChunk&) { return std::optional<v1::ServeOracleRequest>(); });
    while (worker.chunks() == 0) std::this_thread::yield();
  }
  EXPECT_TRUE(server_->Stop(10h));
}

TEST_F(ServerTest, StoppingInAHurryEndsStreamsWithUnavailable) {
  Start();
  const std::string name = CreateSphere();
  RawWorker worker(stub_.get(), name,
                   [](const v1::QueryChunk&) { return std::optional<v1::ServeOracleRequest>(); });
  while (worker.chunks() == 0) std::this_thread::yield();
  grpc::ClientContext context;
  v1::WatchMeshRequest request;
  request.set_name(name);
  const auto reader = stub_->WatchMesh(&context, request);
  v1::WatchMeshResponse event;
  ASSERT_TRUE(reader->Read(&event));
  auto reading = std::async(std::launch::async, [&] {
    while (reader->Read(&event)) {
    }
    return reader->Finish();
  });
  EXPECT_TRUE(server_->Stop(600s, [] { return true; }));
  EXPECT_EQ(worker.Wait().error_code(), grpc::StatusCode::UNAVAILABLE);
  const grpc::Status ended = reading.get();
  EXPECT_EQ(ended.error_code(), grpc::StatusCode::UNAVAILABLE) << ended.error_message();
}

}  // namespace
}  // namespace stellate::server::testing
