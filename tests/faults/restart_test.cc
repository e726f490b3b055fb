// A server with many meshes, finished and not, is killed and started again: it needs no more memory
// than before, and what was finished is there at once.
//
// $STELLATE_RESTARTS: how often (3).

#include <fstream>
#include <iostream>

#include "tests/faults/fault_test.h"

namespace stellate::server {
namespace {

using namespace std::chrono_literals;
using testing::Bytes;
using testing::ExpectSame;
using testing::FromEnvironment;
using testing::RawWorker;
using testing::Watch;

class Restart : public testing::FaultTest {
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

  static std::string CreateLarge(v1::Stellate::Stub* stub) {
    grpc::ClientContext context;
    v1::CreateMeshRequest request;
    *request.mutable_spec() = SpecOfSphere(0.03);
    v1::Mesh mesh;
    EXPECT_TRUE(stub->CreateMesh(&context, request, &mesh).ok());
    return mesh.name();
  }
};

TEST_F(Restart, TakesNoMoreMemoryThanBefore) {
  constexpr int kFinished = 12;
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
  // And they go on.
  const RawWorker worker(server->stub(), halves[0]);
  const auto whole = Watch(server->stub(), halves[0]);
  ASSERT_TRUE(whole);
  ExpectSame(*whole, *first);
}

}  // namespace
}  // namespace stellate::server
