// A server with many meshes, finished and not, is killed and started again: it needs no more memory
// than before, and what was finished is there at once.
//
// $STELLATE_RESTARTS: how often (3). $STELLATE_MEMORY_LIMIT_MB: inside a control group that has no
// more memory, where one can be made (none; needs memory's hierarchy of version 1, and the right).

#include <filesystem>
#include <fstream>
#include <iostream>

#include "tests/faults/fault_test.h"

namespace stellate::server::testing {
namespace {

using namespace std::chrono_literals;

class Restart : public FaultTest {
 protected:
  // Of a process, the most that it had at once, in kB.
  static long PeakOf(pid_t process) {
    std::ifstream status("/proc/" + std::to_string(process) + "/status");
    std::string word;
    while (status >> word) {
      if (word != "VmHWM:") continue;
      long peak = 0;
      status >> peak;
      return peak;
    }
    return 0;
  }

  // Every further server is started in a control group of its own. False: none can be made here.
  bool LimitMemory(int megabytes) {
    group_ = "/sys/fs/cgroup/memory/stellate-restart-" + std::to_string(getpid());
    std::error_code error;
    if (!std::filesystem::create_directory(group_, error)) {
      std::cout << "no limit of memory: " << group_ << ": " << error.message() << "\n";
      group_.clear();
      return false;
    }
    std::ofstream(group_ + "/memory.limit_in_bytes") << megabytes << "M";
    const std::string script = directory_ + "/limited";
    std::ofstream(script) << "#!/bin/sh\necho $$ > " << group_ << "/cgroup.procs\nexec '"
                          << std::getenv("STELLATED") << "' \"$@\"\n";
    std::filesystem::permissions(script, std::filesystem::perms::owner_all);
    setenv("STELLATED", script.c_str(), 1);
    return true;
  }

  // How many processes the kernel ended for memory, and what it says of the group.
  void ExpectNoneKilled() const {
    std::ifstream control(group_ + "/memory.oom_control");
    std::string word;
    long limit = 0, most = 0, killed = -1;
    while (control >> word) {
      if (word == "oom_kill") control >> killed;
    }
    std::ifstream(group_ + "/memory.limit_in_bytes") >> limit;
    std::ifstream(group_ + "/memory.max_usage_in_bytes") >> most;
    std::cout << "inside " << (limit >> 20) << " MB, files it wrote included at most "
              << (most >> 20) << " MB; killed for memory: " << killed << "\n";
    EXPECT_EQ(killed, 0);
  }

  ~Restart() override {
    if (!group_.empty()) rmdir(group_.c_str());
  }

  static std::string CreateLarge(v1::Stellate::Stub* stub) {
    grpc::ClientContext context;
    v1::CreateMeshRequest request;
    *request.mutable_spec() = SpecOfSphere(0.03);
    v1::Mesh mesh;
    EXPECT_TRUE(stub->CreateMesh(&context, request, &mesh).ok());
    return mesh.name();
  }

  std::string group_;  // empty: no limit
};

TEST_F(Restart, TakesNoMoreMemoryThanBefore) {
  constexpr int kFinished = 12;
  const int limit = FromEnvironment("STELLATE_MEMORY_LIMIT_MB", 0);
  const bool limited = limit > 0 && LimitMemory(limit);
  auto server = Next();
  std::vector<std::string> names;
  std::optional<Bytes> first;
  for (int i = 0; i < kFinished; ++i) {
    names.push_back(CreateLarge(server->stub()));
    const RawWorker worker(server->stub(), names.back());
    const auto mesh = Watch(server->stub(), names.back());
    ASSERT_TRUE(mesh);
    if (!first) first = mesh;
  }
  // Two that have come half of the way.
  std::vector<std::string> halves;
  for (int i = 0; i < 2; ++i) {
    halves.push_back(CreateLarge(server->stub()));
    std::atomic<bool> enough{false};
    const RawWorker worker(
        server->stub(), halves.back(),
        [&](const v1::QueryChunk& queries) -> std::optional<v1::ServeOracleRequest> {
          if (enough) return std::nullopt;
          return RawWorker::Truly(queries);
        });
    while (GetFrom(server->stub(), halves.back()).progress().fraction() < 0.5) {
      std::this_thread::sleep_for(1ms);
    }
    enough = true;
  }
  long before = PeakOf(server->process().id()), most = 0;
  const int restarts = FromEnvironment("STELLATE_RESTARTS", 3);
  for (int restart = 0; restart < restarts && !HasFailure(); ++restart) {
    server->Kill();
    server = Next();
    ASSERT_TRUE(server->running());
    for (const std::string& name : names) {
      EXPECT_EQ(GetFrom(server->stub(), name).state(), v1::MESH_STATE_SUCCEEDED) << "at once";
    }
    for (const std::string& name : halves) {
      while (GetFrom(server->stub(), name).progress().fraction() < 0.5) {
        std::this_thread::sleep_for(1ms);  // replayed
      }
    }
    const auto mesh = Watch(server->stub(), names[restart % names.size()]);
    ASSERT_TRUE(mesh);
    ExpectSame(*mesh, *first);
    most = std::max(most, PeakOf(server->process().id()));
  }
  std::cout << kFinished << " finished meshes and 2 under way: peak " << before / 1024
            << " MB, after each of " << restarts << " restarts at most " << most / 1024 << " MB\n";
  EXPECT_LE(static_cast<double>(most), 1.1 * static_cast<double>(before));
  if (limited) ExpectNoneKilled();
  // And they go on.
  const RawWorker worker(server->stub(), halves[0]);
  const auto whole = Watch(server->stub(), halves[0]);
  ASSERT_TRUE(whole);
  ExpectSame(*whole, *first);
  server.reset();  // so that its control group is empty
}

}  // namespace
}  // namespace stellate::server::testing
