// A real stellated, killed with SIGKILL at random moments of a mesh and started again on the same
// data directory: every mesh must come out bit for bit as an undisturbed one.
//
// $STELLATE_KILLS: how often (5); $STELLATE_FAULT_SEED: of the moments (1).

#include <iostream>
#include <set>

#include "tests/faults/fault_test.h"

namespace stellate::server::testing {
namespace {

using namespace std::chrono_literals;

class KillServer : public FaultTest {};

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

// Each question of a round may have cost an hour. A kill in the middle of a thousand of them asks
// at most 2 % of what was answered again, and the mesh is the undisturbed one.
TEST_F(KillServer, DearAnswersAreAskedForOnce) {
  constexpr std::uint32_t kQuestions = 1000;
  constexpr int kAnswered = 600;
  const auto create = [&](v1::Stellate::Stub* stub) {
    grpc::ClientContext context;
    v1::CreateMeshRequest request;
    *request.mutable_spec() = SpecOfSphere(0.3);
    request.mutable_spec()->set_box_seeds(kQuestions);
    v1::Mesh mesh;
    EXPECT_TRUE(stub->CreateMesh(&context, request, &mesh).ok());
    return mesh.name();
  };
  auto server = Next();
  std::optional<Bytes> undisturbed;
  {
    const std::string name = create(server->stub());
    const RawWorker worker(server->stub(), name);
    undisturbed = Watch(server->stub(), name);
  }
  ASSERT_TRUE(undisturbed);

  const std::string name = create(server->stub());
  std::set<std::string> answered;  // questions of the round, as their bytes
  int repeated = 0;
  const auto each = [](const v1::QueryChunk& queries, const auto& action) {
    const std::string& points = queries.points().data();
    for (std::size_t at = 0; at < points.size(); at += 3 * sizeof(double)) {
      action(points.substr(at, 3 * sizeof(double)));
    }
  };
  {
    std::atomic<int> count{0};
    const RawWorker worker(
        server->stub(), name,
        [&](const v1::QueryChunk& queries) -> std::optional<v1::ServeOracleRequest> {
          if (count >= kAnswered) return std::nullopt;
          std::this_thread::sleep_for(queries.points().shape(0) * 1ms);
          each(queries, [&](const std::string& question) { answered.insert(question); });
          count = static_cast<int>(answered.size());
          return RawWorker::Truly(queries);
        });
    while (count < kAnswered) std::this_thread::sleep_for(1ms);
    // Until the last of them are on the disk, however slow that is today.
    std::this_thread::sleep_for(
        std::chrono::milliseconds(FromEnvironment("STELLATE_PAUSE_MS", 2000)));
    server->Kill();
  }
  EXPECT_LT(answered.size(), kQuestions) << "it is in the middle of the round";
  server = Next();
  const RawWorker worker(
      server->stub(), name,
      [&](const v1::QueryChunk& queries) -> std::optional<v1::ServeOracleRequest> {
        each(queries,
             [&](const std::string& question) { repeated += answered.contains(question) ? 1 : 0; });
        return RawWorker::Truly(queries);
      });
  const auto mesh = Watch(server->stub(), name);
  ASSERT_TRUE(mesh);
  ExpectSame(*mesh, *undisturbed);
  std::cout << repeated << " of " << answered.size() << " answered questions asked again\n";
  EXPECT_LE(repeated, static_cast<int>(kQuestions / 50));
}

}  // namespace
}  // namespace stellate::server::testing
