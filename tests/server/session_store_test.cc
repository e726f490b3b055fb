#include "server/session_store.h"

#include <gtest/gtest.h>

#include <future>
#include <set>
#include <thread>

#include "tests/server/sphere.h"
#include "tests/support/stub_mesher.h"

namespace stellate::server {
namespace {

using namespace std::chrono_literals;

SessionOptions Options(Clock::duration worker_wait = 60s) {
  SessionOptions options;
  options.spec = testing::SphereSpec(0.3);
  options.dispatch.worker_wait = worker_wait;
  return options;
}

void WaitUntilOver(const Session& session) {
  while (!session.Over()) std::this_thread::sleep_for(1ms);
}

TEST(MeshName, IsOfItsFormAndNeverTheSame) {
  std::set<std::string> names;
  for (int i = 0; i < 1000; ++i) {
    const std::string name = NewMeshName();
    EXPECT_TRUE(IsMeshName(name)) << name;
    EXPECT_TRUE(names.insert(name).second);
  }
}

TEST(MeshName, OtherFormsAreTold) {
  const std::string good = NewMeshName();
  for (const std::string& bad :
       {std::string(), std::string("meshes/"), good + "0", good.substr(0, good.size() - 1),
        "other/" + good.substr(7), "meshes/" + std::string(32, 'g'),
        "meshes/" + std::string(32, 'A'), std::string(1 << 20, 'a')}) {
    EXPECT_FALSE(IsMeshName(bad)) << bad.substr(0, 50);
  }
}

TEST(SessionStore, FindsListsAndDeletes) {
  SessionStore store({});
  const auto a = *store.Create(Options());
  const auto b = *store.Create(Options());
  EXPECT_EQ(store.Find(a->options().name), a);
  const auto page = store.List(0, 1);
  ASSERT_EQ(page.sessions.size(), 1u);
  EXPECT_EQ(page.sessions[0], a) << "oldest first";
  EXPECT_TRUE(page.more);
  const auto rest = store.List(page.numbers[0], 10);
  ASSERT_EQ(rest.sessions.size(), 1u);
  EXPECT_EQ(rest.sessions[0], b);
  EXPECT_FALSE(rest.more);
  EXPECT_TRUE(store.Delete(a->options().name));
  EXPECT_FALSE(store.Delete(a->options().name));
  EXPECT_EQ(store.Find(a->options().name), nullptr);
  EXPECT_EQ(a->View().state, SessionState::kCancelled);
  WaitUntilOver(*a);
  EXPECT_EQ(store.Running(), 1u);
}

TEST(SessionStore, RefusesMoreThanItsLimitAndTakesMoreWhenOneEnds) {
  SessionStore store({2, 10, 1h});
  const auto a = *store.Create(Options());
  ASSERT_TRUE(store.Create(Options()));
  const auto refused = store.Create(Options());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, core::StatusCode::kLimitExceeded);
  a->Cancel();
  WaitUntilOver(*a);
  EXPECT_TRUE(store.Create(Options()));
}

// A mesher that asks for one point, and is not destroyed before the test says so.
class SlowToGo : public stellate::testing::StubMesher {
 public:
  SlowToGo(core::Specification spec, std::shared_future<void> gate)
      : StubMesher(std::move(spec)), gate_(std::move(gate)) {}
  ~SlowToGo() override { gate_.wait(); }

  const core::QueryBatch* NextBatch() override { return IsOver() ? nullptr : &batch_; }
  core::Expected<core::MeshDelta> Absorb(const core::Answers&) override {
    return core::Refuse(core::StatusCode::kCancelled, "never asked");
  }

 private:
  const std::shared_future<void> gate_;
};

TEST(SessionStore, MeshesBeingTakenApartTakeNoPlaceButAreBounded) {
  constexpr std::size_t kMostEnding = 16;
  std::promise<void> gate;
  SessionStore store({1, 100, 1h},
                     [future = gate.get_future().share()](core::Specification spec)
                         -> core::Expected<std::unique_ptr<core::Mesher>> {
                       return std::make_unique<SlowToGo>(std::move(spec), future);
                     });
  const auto budget = std::make_shared<MemoryBudget>(MemoryBudget::Limits{});
  std::vector<std::shared_ptr<Session>> ended;
  for (std::size_t i = 0; i < kMostEnding; ++i) {
    SessionOptions options = Options();
    options.memory = MemoryBudget::Open(budget, "");
    auto created = store.Create(std::move(options));
    ASSERT_TRUE(created) << i << " are being taken apart";
    ended.push_back(std::move(*created));
    while (ended.back()->View().bytes == 0) std::this_thread::sleep_for(1ms);  // it has begun
    ended.back()->Cancel();
    while (!ended.back()->HasEnded()) std::this_thread::sleep_for(1ms);
    EXPECT_FALSE(ended.back()->Over());
  }
  EXPECT_GT(budget->total(), 0u) << "their memory is not there for others yet";
  const auto refused = store.Create(Options());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().limit->setting, "max-meshes");
  gate.set_value();
  for (const auto& session : ended) WaitUntilOver(*session);
  EXPECT_TRUE(store.Create(Options()));
}

TEST(SessionStore, HoldsEachNamedOwnerToItsShare) {
  SessionStore store({4, 10, 1h, 1});
  const auto create = [&store](const std::string& owner) {
    SessionOptions options = Options();
    options.owner = owner;
    return store.Create(std::move(options));
  };
  const auto first = create("alice");
  ASSERT_TRUE(first);
  const auto refused = create("alice");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, core::StatusCode::kLimitExceeded);
  ASSERT_TRUE(refused.error().limit);
  EXPECT_EQ(refused.error().limit->setting, "owner-meshes");
  EXPECT_EQ(refused.error().limit->scope, "owner");
  EXPECT_TRUE(create("bob"));
  EXPECT_TRUE(create(""));
  EXPECT_TRUE(create("")) << "nobody in particular";
  EXPECT_EQ(create("carol").error().limit->setting, "max-meshes") << "the server is full";
  (*first)->Cancel();
  WaitUntilOver(**first);
  EXPECT_TRUE(create("alice"));
}

TEST(SessionStore, SweepForgetsFinishedMeshesByNumberAndAge) {
  SessionStore store({10, 2, 1h});
  std::vector<std::shared_ptr<Session>> sessions;
  for (int i = 0; i < 4; ++i) sessions.push_back(*store.Create(Options()));
  for (int i = 0; i < 3; ++i) {
    sessions[i]->Cancel();
    WaitUntilOver(*sessions[i]);
  }
  const TimePoint now = Clock::now();
  store.Sweep(now);
  EXPECT_EQ(store.Find(sessions[0]->options().name), nullptr) << "two are kept";
  EXPECT_NE(store.Find(sessions[1]->options().name), nullptr);
  store.Sweep(now + 2h);
  EXPECT_EQ(store.Find(sessions[1]->options().name), nullptr);
  EXPECT_EQ(store.Find(sessions[2]->options().name), nullptr);
  EXPECT_NE(store.Find(sessions[3]->options().name), nullptr) << "it is running";
}

TEST(SessionStore, StopCancelsWhatRuns) {
  SessionStore store({});
  const auto session = *store.Create(Options());
  EXPECT_TRUE(store.Stop(Clock::now() + 60s));
  EXPECT_EQ(session->View().state, SessionState::kCancelled);
  EXPECT_FALSE(store.Create(Options())) << "stopped";
}

}  // namespace
}  // namespace stellate::server
