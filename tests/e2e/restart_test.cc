// A server that is killed, stopped or frozen in the middle of a mesh, and comes back: the client
// waits, and the mesh is the undisturbed one.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "live.h"
#include "stellate/monitor.h"
#include "support/spoiled_oracle.h"

namespace stellate::testing {
namespace {

namespace fs = std::filesystem;

// A stellated that can be ended and started again on the same address and data.
class MortalServer {
 public:
  explicit MortalServer(const std::string& directory) : directory_(directory) {
    fs::remove_all(directory);
    fs::create_directories(directory);
    Start();
  }
  ~MortalServer() {
    if (pid_ > 0) End(SIGKILL);
    fs::remove_all(directory_);
  }

  void Start(bool with_memory = true) {
    const std::string ready = directory_ + "/ready", data = directory_ + "/data";
    const std::string listen = address(), program = std::getenv("STELLATED");
    fs::remove(ready);
    std::vector<const char*> arguments = {
        program.c_str(), "--listen", listen.c_str(),       "--ready-file",    ready.c_str(),
        "--log-level",   "off",      "--exit-with-parent", "--drain-seconds", "0"};
    if (with_memory) arguments.insert(arguments.end(), {"--data-dir", data.c_str()});
    arguments.push_back(nullptr);
    pid_ = fork();
    if (pid_ == 0) {
      execv(program.c_str(), const_cast<char* const*>(arguments.data()));
      _exit(127);
    }
    while (!fs::exists(ready) && waitpid(pid_, nullptr, WNOHANG) == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    EXPECT_TRUE(fs::exists(ready)) << "the server did not start";
  }
  void End(int with_signal) {
    kill(pid_, with_signal);
    waitpid(pid_, nullptr, 0);
    pid_ = 0;
  }
  void Send(int with_signal) const { kill(pid_, with_signal); }
  // Returns once all its threads stand still.
  void Freeze() const {
    Send(SIGSTOP);
    waitpid(pid_, nullptr, WUNTRACED);
  }
  std::string address() const { return "unix:" + directory_ + "/socket"; }

 private:
  const std::string directory_;
  pid_t pid_ = 0;
};

class Restart : public ::testing::Test {
 protected:
  explicit Restart(const std::string& manifold = "torus:1:0.4")
      : server_((fs::temp_directory_path() / ("stellate-restart-" + std::to_string(getpid())))
                    .string()),
        torus_(MakeManifold(manifold).value()),
        oracle_(*torus_) {
    options_.epsilon = 0.15;
    options_.connection.server = server_.address();
    options_.connection.on_outage = [this](const Outage& outage) {
      ++(outage.over ? returns_ : failures_);
      if (!outage.over && on_failure_) on_failure_();
    };
  }

  // Has `happens` come to pass while the oracle is at the first batch after `batches` others, of
  // closest points or flats; then again after as many, as long as disasters are left.
  void AfterBatches(int batches, std::function<void()> happens) {
    const auto count = [=, this] {
      if (++asked_ % (batches + 1) == 0 && disasters_ > 0) {
        --disasters_;
        happens();
      }
    };
    oracle_.on_closest = [count](const auto&, Answer&) { count(); };
    oracle_.on_flat = [count](const auto&, const auto&, const auto&, Answer&) { count(); };
  }

  void ExpectTheUndisturbedMesh() {
    const Expected<Mesh> mesh = MeshManifold(oracle_, options_);
    ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
    EXPECT_EQ(disasters_, 0) << "nothing happened";
    EXPECT_GE(failures_, 1);
    EXPECT_GE(returns_, 1);
    options_.connection.keepalive = Seconds(60);
    const Expected<Mesh> undisturbed = MeshManifold(*torus_, options_);
    ASSERT_TRUE(undisturbed.has_value()) << undisturbed.error().message;
    EXPECT_TRUE(AreIdentical(*mesh, *undisturbed));
    EXPECT_TRUE(mesh->report.certified());
  }

  MortalServer server_;
  const std::unique_ptr<Manifold> torus_;
  SpoiledOracle oracle_;
  MeshOptions options_;
  int asked_ = 0;  // batches
  int disasters_ = 1;
  int failures_ = 0, returns_ = 0;
  std::function<void()> on_failure_;
};

class GradedRestart : public Restart {
 protected:
  GradedRestart() : Restart("torus:1:0.8") {
    options_.epsilon = 0.4;
    options_.size_rate = 0.3;
  }
};

TEST_F(GradedRestart, KilledTwiceTheServerIsWaitedForAndReplaysSizes) {
  disasters_ = 2;
  AfterBatches(6, [this] {
    server_.End(SIGKILL);
    server_.Start();
  });
  ExpectTheUndisturbedMesh();
}

TEST_F(Restart, AStoppedServerIsWaitedFor) {
  AfterBatches(4, [this] {
    server_.End(SIGTERM);
    server_.Start();
  });
  ExpectTheUndisturbedMesh();
}

TEST_F(Restart, AFrozenServerIsFoundByPings) {
  options_.connection.keepalive = Seconds(0.5);
  AfterBatches(3, [this] { server_.Send(SIGSTOP); });
  on_failure_ = [this] { server_.Send(SIGCONT); };
  ExpectTheUndisturbedMesh();
}

TEST_F(Restart, AServerThatStaysAwayIsGivenUp) {
  options_.connection.reconnect = Seconds(0.2);
  AfterBatches(2, [this] { server_.End(SIGKILL); });
  const Expected<Mesh> mesh = MeshManifold(oracle_, options_);
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kServerFailed);
}

TEST_F(Restart, AServerThatForgotIsNotWaitedFor) {
  AfterBatches(2, [this] {
    server_.End(SIGKILL);
    server_.Start(/*with_memory=*/false);
  });
  const Expected<Mesh> mesh = MeshManifold(oracle_, options_);
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kServerFailed);
  EXPECT_NE(mesh.error().message.find("--data-dir"), std::string::npos) << mesh.error().message;
}

TEST_F(Restart, TheWaitCanBeCancelled) {
  std::stop_source source;
  options_.stop = source.get_token();
  AfterBatches(2, [this] { server_.End(SIGKILL); });
  on_failure_ = [&source] { source.request_stop(); };
  const Expected<Mesh> mesh = MeshManifold(oracle_, options_);
  ASSERT_FALSE(mesh.has_value());
  EXPECT_NE(mesh.error().message.find("cancelled"), std::string::npos) << mesh.error().message;
}

TEST_F(Restart, CallsToAFrozenServerEndAtTheirDeadlines) {
  Monitor monitor = Monitor::Connect({server_.address()}).value();
  ASSERT_TRUE(monitor.Health(Seconds(60)).has_value());
  server_.Freeze();
  const auto health = monitor.Health(Seconds(0.3));
  const auto meshes = monitor.Meshes(Seconds(0.3));
  server_.Send(SIGCONT);
  ASSERT_FALSE(health.has_value());
  EXPECT_EQ(health.error().code, ErrorCode::kServerFailed);
  ASSERT_FALSE(meshes.has_value());
  EXPECT_EQ(meshes.error().code, ErrorCode::kServerFailed);
  while (!monitor.Meshes(Seconds(60)).has_value()) {  // the test's limit ends it
  }
}

}  // namespace
}  // namespace stellate::testing
