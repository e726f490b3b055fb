// A real stellated, killed with SIGKILL at random moments of a mesh and started again on the same
// data directory: every mesh must come out bit for bit as an undisturbed one.
//
// $STELLATE_KILLS: how often (5); $STELLATE_FAULT_SEED: of the moments (1).

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
using testing::WatchFrom;

class KillServer : public testing::FaultTest {};

TEST_F(KillServer, EveryMeshResumesAndIsTheUndisturbedOne) {
  const int kills_wanted = FromEnvironment("STELLATE_KILLS", 5);
  auto server = Next();
  const std::optional<Bytes> undisturbed = Undisturbed(server->stub());
  ASSERT_TRUE(undisturbed);
  ASSERT_EQ(undisturbed->state, v1::MESH_STATE_SUCCEEDED);

  std::string name;
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
        if (GetFrom(server->stub(), name).has_end_time()) break;
        ASSERT_FALSE(HasFailure()) << "the mesh is lost";
        std::this_thread::sleep_for(1ms);
      }
      std::jthread killer;
      std::atomic<bool> killed{false};
      if (!spare) {
        const std::chrono::duration<double> wait = Moment();
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
