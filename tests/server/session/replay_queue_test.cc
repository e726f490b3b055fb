// What a store makes of the meshes that an earlier server recorded.

#include <set>

#include "server/session/session_store.h"
#include "tests/server/support/journal_fixture.h"

namespace stellate::server {
namespace {

using testing::JournalTest;
using testing::RecordedSphere;

class ReplayQueue : public JournalTest {
 protected:
  // Leaves meshes that are under way, and one that has ended.
  void Leave(int unfinished) {
    const auto journal = Open();
    for (int number = 0; number < unfinished; ++number) {
      SessionOptions options = Named(number);
      options.ports.journal = journal->NewMesh();
      testing::RunMesh(std::move(options), 4);
    }
    SessionOptions options = Named(unfinished);
    options.ports.journal = journal->NewMesh();
    testing::RunMesh(std::move(options));
  }
  static SessionOptions Named(int number) {
    SessionOptions options = RecordedSphere(nullptr);
    options.request.name = core::Message("meshes/", std::string(31, '0'), number);
    return options;
  }

  // A mesher that notes how many of its kind there are, and waits in the first round to be let go.
  Session::MesherFactory Counting() {
    return [this](core::Specification spec, core::Execution execution) {
      {
        std::unique_lock lock(mutex_);
        most_ = std::max(most_, ++meshing_);
        changed_.notify_all();
        changed_.wait(lock, [this] { return go_; });
      }
      return core::Mesher::Create(std::move(spec), execution);
    };
  }
  void WaitForMeshers(int count) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return meshing_ >= count; });
  }
  void Go() {
    const std::lock_guard lock(mutex_);
    go_ = true;
    changed_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  int meshing_ = 0, most_ = 0;
  bool go_ = false;
};

TEST_F(ReplayQueue, AFewAtATimeAndFinishedOnesAtOnce) {
  Leave(5);
  const auto journal = Open();
  SessionStore store({}, Counting());
  for (SessionOptions& options : journal->TakeMeshes()) store.Restore(std::move(options));
  const auto finished = store.Find(Named(5).request.name);
  ASSERT_NE(finished, nullptr);
  EXPECT_TRUE(finished->Over());
  EXPECT_EQ(finished->View().state, SessionState::kSucceeded);
  WaitForMeshers(2);
  EXPECT_EQ(store.Running(), 5u);
  EXPECT_EQ(store.Find(Named(4).request.name)->View().state, SessionState::kWaiting);
  const std::uint64_t revision = store.Find(Named(4).request.name)->history().PublishedRevision();
  EXPECT_GE(revision, 4u) << "as a watcher may have it";
  // One in the queue can be deleted; what is cancelled there is replayed first.
  EXPECT_TRUE(store.Delete(Named(3).request.name));
  store.Find(Named(4).request.name)->Cancel();
  EXPECT_EQ(store.Find(Named(4).request.name)->View().state, SessionState::kCancelled);
  {
    const std::lock_guard lock(mutex_);
    EXPECT_EQ(most_, 2) << "and no more";
  }
  Go();
  const auto cancelled = store.Find(Named(4).request.name);
  while (!cancelled->Over()) std::this_thread::yield();
  EXPECT_EQ(cancelled->View().state, SessionState::kCancelled);
  EXPECT_EQ(cancelled->View().revision, revision);
  const std::lock_guard lock(mutex_);
  EXPECT_LE(meshing_, 4) << "not the deleted one";
}

TEST_F(ReplayQueue, AsTheMemoryBudgetAllows) {
  Leave(3);
  const auto journal = Open();
  SessionStore store({}, Counting());
  std::shared_ptr<MemoryBudget> budget;
  for (SessionOptions& options : journal->TakeMeshes()) {
    options.record->last.vertices = 1000;
    if (budget == nullptr) {
      const std::uint64_t one = EstimateMeshBytes(options.request.spec, 1000, 0);
      budget = std::make_shared<MemoryBudget>(MemoryBudget::Limits{one * 3 / 2, 0});
    }
    options.ports.memory = MemoryBudget::Open(budget, options.request.owner);
    store.Restore(std::move(options));
  }
  WaitForMeshers(1);
  store.Sweep(Clock::now());
  {
    const std::lock_guard lock(mutex_);
    EXPECT_EQ(meshing_, 1) << "there is no room for two";
  }
  EXPECT_TRUE(store.Find(Named(1).request.name)->IsReplaying());
  Go();
  const auto all_replayed = [&] {
    const auto meshes = store.All();
    return std::none_of(meshes.begin(), meshes.end(),
                        [](const auto& session) { return session->IsReplaying(); });
  };
  while (!all_replayed()) {
    store.Sweep(Clock::now());
    std::this_thread::yield();
  }
}

TEST_F(ReplayQueue, AHistoryIsReadBackForWhoeverAsks) {
  Leave(0);
  const auto journal = Open();
  SessionStore store({});
  for (SessionOptions& options : journal->TakeMeshes()) store.Restore(std::move(options));
  const auto session = store.Find(Named(0).request.name);
  ASSERT_NE(session, nullptr);
  struct Watcher : SessionWatcher {
    void Wake() override { woken = true; }
    std::atomic<bool> woken{false};
  };
  const auto watcher = std::make_shared<Watcher>();
  ASSERT_TRUE(session->history().AddWatcher(watcher));
  EXPECT_EQ(store.OpenHistory(session), nullptr);
  while (!watcher->woken) std::this_thread::yield();
  auto history = store.OpenHistory(session);
  ASSERT_NE(history, nullptr);
  EXPECT_EQ(history->revision(), session->View().revision);
  EXPECT_FALSE(store.UnloadHistories()) << "it is being read";
  history.reset();
  EXPECT_TRUE(store.UnloadHistories());
  EXPECT_EQ(session->history().loaded(), nullptr);
}

}  // namespace
}  // namespace stellate::server
