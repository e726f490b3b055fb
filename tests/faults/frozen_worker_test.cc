// Workers that are frozen (SIGSTOP) at random moments, with chunks in their hands, and thawed
// later: nobody hangs up, and yet the mesh goes on, and is bit for bit the undisturbed one.
//
// $STELLATE_FREEZES: how often (2); $STELLATE_NAP_SECONDS: for how long at most (1);
// $STELLATE_FAULT_SEED: of the moments (1).

#include <filesystem>
#include <iostream>

#include "tests/faults/fault_test.h"

namespace stellate::server::testing {
namespace {

using namespace std::chrono_literals;

class FrozenWorker : public FaultTest {};

TEST_F(FrozenWorker, TheMeshGoesOnAndIsTheUndisturbedOne) {
  const int wanted = FromEnvironment("STELLATE_FREEZES", 2);
  const double longest_nap = FromEnvironment("STELLATE_NAP_SECONDS", 1);
  auto server = Next();
  const std::optional<Bytes> undisturbed = Undisturbed(server->stub());
  ASSERT_TRUE(undisturbed);
  int freezes = 0, meshes = 0;
  while (freezes < wanted) {
    // Far more than this test may take: what frees a chunk is not its lease.
    const std::string name = Create(server->stub(), 3000);
    ++meshes;
    const std::string program =
        std::filesystem::path(std::getenv("STELLATED")).replace_filename("fault_worker");
    std::vector<std::unique_ptr<Process>> workers;
    for (int i = 0; i < 2; ++i) {
      workers.push_back(
          std::make_unique<Process>(std::vector<std::string>{program, server->address(), name}));
    }
    std::uniform_real_distribution<double> nap(0, longest_nap);
    std::jthread freezer([&, wait = Moment(), asleep = std::chrono::duration<double>(nap(random_)),
                          victim = random_() % 2](std::stop_token over) {
      std::this_thread::sleep_for(wait);
      workers[victim]->Freeze();
      const auto until = std::chrono::steady_clock::now() + asleep;
      while (!over.stop_requested() && std::chrono::steady_clock::now() < until) {
        std::this_thread::sleep_for(2ms);
      }
      workers[victim]->Thaw();
    });
    const std::optional<Bytes> mesh = Watch(server->stub(), name);
    freezer.request_stop();
    freezer.join();
    ++freezes;
    ASSERT_TRUE(mesh);
    ExpectSame(*mesh, *undisturbed);
    if (HasFailure()) break;
  }
  std::cout << freezes << " freezes, " << meshes << " meshes\n";
}

}  // namespace
}  // namespace stellate::server::testing
