#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "tests/server/support/live_server.h"

namespace stellate::server::testing {

inline int FromEnvironment(const char* name, int otherwise) {
  const char* const text = std::getenv(name);
  return text == nullptr ? otherwise : std::atoi(text);
}

// A program of its own, killed at the latest when this goes.
class Process {
 public:
  explicit Process(std::vector<std::string> command) {
    std::vector<char*> arguments;
    for (std::string& word : command) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    pid_ = fork();
    if (pid_ != 0) return;
    // A write beyond a limit on file sizes is an error to handle, not a signal to die of.
    signal(SIGXFSZ, SIG_IGN);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  ~Process() { Kill(); }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void Kill() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = 0;
  }
  // Freezes it, until Thaw.
  void Freeze() { kill(pid_, SIGSTOP); }
  void Thaw() { kill(pid_, SIGCONT); }
  // From now on its files can grow to `bytes` at most.
  void LimitFiles(rlim_t bytes) {
    const rlimit limit{bytes, RLIM_INFINITY};
    ASSERT_EQ(prlimit(pid_, RLIMIT_FSIZE, &limit, nullptr), 0);
  }
  pid_t id() const { return pid_; }
  bool Ended() {
    if (pid_ > 0 && waitpid(pid_, nullptr, WNOHANG) != 0) pid_ = 0;
    return pid_ == 0;
  }

 private:
  pid_t pid_ = 0;
};

// A stellated on a unix socket, and a stub to it.
class ServerProcess {
 public:
  // `number` tells servers of one directory apart.
  ServerProcess(const std::string& directory, const std::string& data, int number,
                const std::vector<std::string>& flags)
      : address_("unix:" + directory + "/socket-" + std::to_string(number)) {
    const std::string ready = directory + "/ready-" + std::to_string(number);
    std::vector<std::string> command{std::getenv("STELLATED"),
                                     "--listen",
                                     address_,
                                     "--ready-file",
                                     ready,
                                     "--data-dir",
                                     data,
                                     "--log-level",
                                     "error"};
    command.insert(command.end(), flags.begin(), flags.end());
    process_ = std::make_unique<Process>(std::move(command));
    while (!std::filesystem::exists(ready) && !process_->Ended()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    running_ = std::filesystem::exists(ready);
    stub_ =
        v1::Stellate::NewStub(grpc::CreateChannel(address_, grpc::InsecureChannelCredentials()));
  }

  void Kill() { process_->Kill(); }
  Process& process() { return *process_; }
  bool running() const { return running_; }
  const std::string& address() const { return address_; }
  v1::Stellate::Stub* stub() { return stub_.get(); }

 private:
  const std::string address_;
  std::unique_ptr<Process> process_;
  bool running_ = false;
  std::unique_ptr<v1::Stellate::Stub> stub_;
};

// All of a mesh, as its bytes on the wire.
struct Bytes {
  std::string points, simplices;
  v1::MeshState state = v1::MESH_STATE_UNSPECIFIED;
  std::string failure;  // its reason, if it failed
  std::uint64_t revision = 0;
};

// From a revision to the end; nothing if the server is gone before it.
inline std::optional<Bytes> WatchFrom(v1::Stellate::Stub* stub, const std::string& name,
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
      bytes.failure = event.final().report().failure().reason();
      bytes.revision = event.final().revision();
    }
  }
  if (!reader->Finish().ok() || bytes.state == v1::MESH_STATE_UNSPECIFIED) return std::nullopt;
  return bytes;
}

// Waiting for the end first makes the geometry one change, without removals.
inline std::optional<Bytes> Watch(v1::Stellate::Stub* stub, const std::string& name) {
  if (!WatchFrom(stub, name, 0, true)) return std::nullopt;
  return WatchFrom(stub, name, 0, false);
}

inline void ExpectSame(const Bytes& mesh, const Bytes& undisturbed) {
  EXPECT_EQ(mesh.state, v1::MESH_STATE_SUCCEEDED) << mesh.failure;
  EXPECT_EQ(mesh.revision, undisturbed.revision);
  EXPECT_TRUE(mesh.points == undisturbed.points) << "points differ";
  EXPECT_TRUE(mesh.simplices == undisturbed.simplices) << "simplices differ";
}

// A directory of one's own, and servers on it one after the other.
class FaultTest : public LiveServer {
 protected:
  FaultTest()
      : directory_(::testing::TempDir() + "stellate-faults-" + std::to_string(getpid())),
        data_(directory_ + "/data") {
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_);
  }
  ~FaultTest() override { std::filesystem::remove_all(directory_); }

  std::unique_ptr<ServerProcess> Next(const std::vector<std::string>& flags = {}) {
    auto server = std::make_unique<ServerProcess>(directory_, data_, ++servers_, flags);
    EXPECT_TRUE(server->running());
    return server;
  }

  static std::string Create(v1::Stellate::Stub* stub, double answer_seconds = 0) {
    grpc::ClientContext context;
    v1::CreateMeshRequest request;
    *request.mutable_spec() = SpecOfSphere(0.1);
    request.mutable_spec()->mutable_limits()->set_answer_seconds(answer_seconds);
    v1::Mesh mesh;
    const grpc::Status status = stub->CreateMesh(&context, request, &mesh);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return mesh.name();
  }

  static v1::Mesh GetFrom(v1::Stellate::Stub* stub, const std::string& name) {
    grpc::ClientContext context;
    v1::GetMeshRequest request;
    request.set_name(name);
    v1::Mesh mesh;
    const grpc::Status status = stub->GetMesh(&context, request, &mesh);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return mesh;
  }

  // Answers at the pace of an oracle that has something to do.
  static std::optional<v1::ServeOracleRequest> Slowly(const v1::QueryChunk& queries) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return RawWorker::Truly(queries);
  }

  // A mesh that nobody disturbs, and how long it takes.
  std::optional<Bytes> Undisturbed(v1::Stellate::Stub* stub) {
    const auto begin = std::chrono::steady_clock::now();
    const std::string name = Create(stub);
    const RawWorker worker(stub, name, Slowly);
    std::optional<Bytes> mesh = Watch(stub, name);
    usual_ = std::chrono::steady_clock::now() - begin;
    return mesh;
  }

  // A moment of a mesh.
  std::chrono::duration<double> Moment() {
    return std::chrono::duration<double>(
        std::uniform_real_distribution<double>(0, usual_.count())(random_));
  }

  const std::string directory_;
  std::string data_;
  std::mt19937 random_{static_cast<unsigned>(FromEnvironment("STELLATE_FAULT_SEED", 1))};

 private:
  std::chrono::duration<double> usual_{0};
  int servers_ = 0;
};

}  // namespace stellate::server::testing
