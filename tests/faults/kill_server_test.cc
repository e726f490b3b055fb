// A real stellated, killed with SIGKILL at random moments of a mesh and started again on the same
// data directory: every mesh must come out bit for bit as an undisturbed one.
//
// $STELLATE_KILLS: how often (5); $STELLATE_KILL_SEED: of the moments (1).

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <random>
#include <thread>

#include "tests/server/live_server.h"

namespace stellate::server {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;
using testing::RawWorker;

int FromEnvironment(const char* name, int otherwise) {
  const char* const text = std::getenv(name);
  return text == nullptr ? otherwise : std::atoi(text);
}

// A process of its own; killed at the latest when this goes.
class ServerProcess {
 public:
  ServerProcess(const std::string& directory, int number)
      : address_("unix:" + directory + "/socket-" + std::to_string(number)) {
    const std::string ready = directory + "/ready-" + std::to_string(number);
    const char* const program = std::getenv("STELLATED");
    pid_ = fork();
    if (pid_ == 0) {
      const std::string data = directory + "/data";
      execl(program, program, "--listen", address_.c_str(), "--ready-file", ready.c_str(),
            "--data-dir", data.c_str(), "--log-level", "warning", nullptr);
      _exit(127);
    }
    int status = 0;
    while (!fs::exists(ready) && waitpid(pid_, &status, WNOHANG) == 0) {
      std::this_thread::sleep_for(2ms);
    }
    running_ = fs::exists(ready);
    stub_ =
        v1::Stellate::NewStub(grpc::CreateChannel(address_, grpc::InsecureChannelCredentials()));
  }
  ~ServerProcess() { Kill(); }

  void Kill() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = 0;
  }
  bool running() const { return running_; }
  v1::Stellate::Stub* stub() { return stub_.get(); }

 private:
  const std::string address_;
  pid_t pid_ = 0;
  bool running_ = false;
  std::unique_ptr<v1::Stellate::Stub> stub_;
};

// All of a mesh, as its bytes on the wire.
struct Bytes {
  std::string points, simplices;
  v1::MeshState state = v1::MESH_STATE_UNSPECIFIED;
  std::uint64_t revision = 0;
};

// From a revision to the end; nothing if the server is gone before it.
std::optional<Bytes> WatchFrom(v1::Stellate::Stub* stub, const std::string& name,
                               std::uint64_t revision, bool progress_only) {
  grpc::ClientContext context;
  v1::WatchMeshRequest request;
  request.set_name(name);
  request.set_from_revision(revision);
  request.set_progress_only(progress_only);
  const auto reader = stub->WatchMesh(&context, request);
  Bytes bytes;
  v1::WatchMeshResponse event;
  while (reader->Read(&event)) {
    if (event.has_delta()) {
      bytes.points += event.delta().delta().points().data();
      bytes.simplices += event.delta().delta().added().data();
    }
    if (event.has_final()) {
      bytes.state = event.final().state();
      bytes.revision = event.final().revision();
    }
  }
  if (!reader->Finish().ok() || bytes.state == v1::MESH_STATE_UNSPECIFIED) return std::nullopt;
  return bytes;
}

// Waiting for the end first makes the geometry one change, without removals.
std::optional<Bytes> Watch(v1::Stellate::Stub* stub, const std::string& name) {
  if (!WatchFrom(stub, name, 0, true)) return std::nullopt;
  return WatchFrom(stub, name, 0, false);
}

class KillServer : public testing::LiveServer {
 protected:
  KillServer() : directory_(::testing::TempDir() + "stellate-kill-" + std::to_string(getpid())) {
    fs::remove_all(directory_);
    fs::create_directories(directory_);
  }
  ~KillServer() override { fs::remove_all(directory_); }

  std::unique_ptr<ServerProcess> Next() {
    auto server = std::make_unique<ServerProcess>(directory_, ++servers_);
    EXPECT_TRUE(server->running());
    return server;
  }

  static std::string Create(v1::Stellate::Stub* stub) {
    grpc::ClientContext context;
    v1::CreateMeshRequest request;
    *request.mutable_spec() = SpecOfSphere(0.1);
    v1::Mesh mesh;
    const grpc::Status status = stub->CreateMesh(&context, request, &mesh);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return mesh.name();
  }

  // Answers at the pace of an oracle that has something to do.
  static std::optional<v1::ServeOracleRequest> Slowly(const v1::QueryChunk& queries) {
    std::this_thread::sleep_for(10ms);
    return RawWorker::Truly(queries);
  }

  const std::string directory_;
  int servers_ = 0;
};

void ExpectSame(const Bytes& mesh, const Bytes& undisturbed) {
  EXPECT_EQ(mesh.state, v1::MESH_STATE_SUCCEEDED);
  EXPECT_EQ(mesh.revision, undisturbed.revision);
  EXPECT_TRUE(mesh.points == undisturbed.points) << "points differ";
  EXPECT_TRUE(mesh.simplices == undisturbed.simplices) << "simplices differ";
}

TEST_F(KillServer, EveryMeshResumesAndIsTheUndisturbedOne) {
  const int kills_wanted = FromEnvironment("STELLATE_KILLS", 5);
  std::mt19937 random(static_cast<unsigned>(FromEnvironment("STELLATE_KILL_SEED", 1)));
  auto server = Next();
  std::string name = Create(server->stub());
  const auto begin = std::chrono::steady_clock::now();
  std::optional<Bytes> undisturbed;
  {
    RawWorker worker(server->stub(), name, Slowly);
    undisturbed = Watch(server->stub(), name);
  }
  ASSERT_TRUE(undisturbed);
  ASSERT_EQ(undisturbed->state, v1::MESH_STATE_SUCCEEDED);
  const std::chrono::duration<double> usual = std::chrono::steady_clock::now() - begin;
  std::uniform_real_distribution<double> moment(0, usual.count());

  int kills = 0, meshes = 0;
  while (kills < kills_wanted) {
    name = Create(server->stub());
    ++meshes;
    std::optional<Bytes> mesh;
    while (!mesh) {
      const bool spare = kills >= kills_wanted;
      const auto worker = std::make_unique<RawWorker>(server->stub(), name, Slowly);
      // What has been asked a question is recorded.
      while (worker->chunks() == 0 && server->running()) {
        grpc::ClientContext context;
        v1::GetMeshRequest request;
        request.set_name(name);
        v1::Mesh now;
        ASSERT_TRUE(server->stub()->GetMesh(&context, request, &now).ok()) << "the mesh is lost";
        if (now.has_end_time()) break;
        std::this_thread::sleep_for(1ms);
      }
      std::jthread killer;
      std::atomic<bool> killed{false};
      if (!spare) {
        const std::chrono::duration<double> wait(moment(random));
        killer = std::jthread([&killed, &server, wait](std::stop_token stop) {
          const auto until = std::chrono::steady_clock::now() + wait;
          while (std::chrono::steady_clock::now() < until) {
            if (stop.stop_requested()) return;
            std::this_thread::sleep_for(1ms);
          }
          killed = true;
          server->Kill();
        });
      }
      mesh = Watch(server->stub(), name);
      killer.request_stop();
      if (killer.joinable()) killer.join();
      if (!killed) {
        ASSERT_TRUE(mesh) << "the watch ended and nobody was killed";
        continue;
      }
      ++kills;
      server = Next();
      ASSERT_TRUE(server->running());
    }
    ExpectSame(*mesh, *undisturbed);
    if (HasFailure()) break;
  }
  std::cout << kills << " kills, " << meshes << " meshes\n";

  // Finished meshes are still there after one more, and cost no worker.
  server->Kill();
  server = Next();
  // Who has it all hears of nothing new, even while the answers are replayed.
  const auto nothing = WatchFrom(server->stub(), name, undisturbed->revision, false);
  ASSERT_TRUE(nothing);
  EXPECT_EQ(nothing->points, "");
  EXPECT_EQ(nothing->revision, undisturbed->revision);
  const auto kept = Watch(server->stub(), name);
  ASSERT_TRUE(kept);
  ExpectSame(*kept, *undisturbed);
}

}  // namespace
}  // namespace stellate::server
