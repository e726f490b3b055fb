// The link of one of two workers breaks at random moments, or falls silent for a while and then
// breaks or goes on: the mesh must be bit for bit the undisturbed one.
//
// $STELLATE_DROPS: how often (6); $STELLATE_FAULT_SEED: of the moments (1).

#include <iostream>

#include "tests/faults/fault_test.h"
#include "tests/faults/persistent_worker.h"
#include "tests/faults/relay.h"

namespace stellate::server::testing {
namespace {

using namespace std::chrono_literals;

class DroppedLink : public FaultTest {};

TEST_F(DroppedLink, TheMeshGoesOnAndIsTheUndisturbedOne) {
  const int wanted = FromEnvironment("STELLATE_DROPS", 6);
  auto server = Next();
  const std::optional<Bytes> undisturbed = Undisturbed(server->stub());
  ASSERT_TRUE(undisturbed);
  const std::string bad_link = directory_ + "/relay";
  Relay relay(bad_link, server->address().substr(std::string("unix:").size()));
  int cuts = 0, silences = 0, meshes = 0;
  while (cuts + silences < wanted) {
    const std::string name = Create(server->stub(), 3000);
    ++meshes;
    // Sometimes the only worker there is.
    std::unique_ptr<PersistentWorker> good;
    if (meshes % 2 == 0) good = std::make_unique<PersistentWorker>(server->address(), name);
    const PersistentWorker bad("unix:" + bad_link, name);
    std::jthread saboteur([&](std::stop_token over) {
      while (!over.stop_requested() && cuts + silences < wanted) {
        std::this_thread::sleep_for(Moment() / 2);
        if (over.stop_requested()) return;
        if (random_() % 3 == 0) {
          relay.Hold(true);
          std::this_thread::sleep_for(Moment());
          relay.Hold(false);
          ++silences;
          if (random_() % 2 == 0) continue;
        }
        relay.Cut();
        ++cuts;
      }
    });
    const std::optional<Bytes> mesh = Watch(server->stub(), name);
    saboteur.request_stop();
    saboteur.join();
    ASSERT_TRUE(mesh);
    ExpectSame(*mesh, *undisturbed);
    if (HasFailure()) break;
  }
  std::cout << cuts << " broken links, " << silences << " silent ones, " << meshes << " meshes\n";
}

}  // namespace
}  // namespace stellate::server::testing
