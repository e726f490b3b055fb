#include "server/session/session_store.h"

#include <gtest/gtest.h>

#include <future>
#include <set>
#include <thread>

#include "tests/server/support/blank_journal.h"
#include "tests/server/support/no_more_threads.h"
#include "tests/server/support/sphere.h"
#include "tests/support/stub_mesher.h"

namespace stellate::server {
namespace {

using namespace std::chrono_literals;

SessionOptions Options(Clock::duration worker_wait = 60s) {
  SessionOptions options;
  options.request.spec = testing::SphereSpec(0.3);
  options.request.timeouts.worker_wait = worker_wait;
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
  EXPECT_EQ(store.Find(a->request().name), a);
  const auto page = store.List(0, 1, "");
  ASSERT_EQ(page.sessions.size(), 1u);
  EXPECT_EQ(page.sessions[0], a) << "oldest first";
  EXPECT_TRUE(page.more);
  const auto rest = store.List(page.numbers[0], 10, "");
  ASSERT_EQ(rest.sessions.size(), 1u);
  EXPECT_EQ(rest.sessions[0], b);
  EXPECT_FALSE(rest.more);
  EXPECT_TRUE(store.Delete(a->request().name));
  EXPECT_FALSE(store.Delete(a->request().name));
  EXPECT_EQ(store.Find(a->request().name), nullptr);
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

TEST(SessionStore, HasOneMeshOfAName) {
  SessionStore store({1, 10, 1h});
  SessionOptions options = Options();
  options.request.name = NewMeshName();
  const std::string name = options.request.name;
  SessionOptions again = Options(), other = Options();
  again.request.name = name;
  const auto made = *store.Create(std::move(options));
  EXPECT_EQ(made->request().name, name);
  const auto same = store.Create(std::move(again));
  ASSERT_TRUE(same) << "one that is there takes no place: " << same.error().message;
  EXPECT_EQ(*same, made);
  EXPECT_FALSE(store.Create(std::move(other))) << "the limit still holds";
}

// Of a server that was killed as it deleted one and took another.
TEST(SessionStore, OfTwoRecordedUnderANameTheLaterIsKept) {
  class Remembering : public testing::BlankJournal {
   public:
    void Forget() override { forgotten = true; }
    std::atomic<bool> forgotten{false};
  };
  SessionStore store({});
  const std::string name = NewMeshName();
  std::vector<std::shared_ptr<Remembering>> journals;
  for (const char* label : {"earlier", "later"}) {
    SessionOptions options = Options();
    options.request.name = name;
    options.request.label = label;
    options.record.emplace();
    journals.push_back(std::make_shared<Remembering>());
    options.ports.journal = journals.back();
    store.Restore(std::move(options));
  }
  EXPECT_TRUE(journals[0]->forgotten);
  EXPECT_FALSE(journals[1]->forgotten);
  EXPECT_EQ(store.Find(name)->request().label, "later");
  EXPECT_EQ(store.All().size(), 1u);
}

// A journal that has a mesh once the test says so, or never will.
class LateJournal : public testing::BlankJournal {
 public:
  std::optional<MeshFailure> WriteStart(const MeshRequest&,
                                        std::chrono::system_clock::time_point) override {
    return gate.get_future().get();
  }
  std::promise<std::optional<MeshFailure>> gate;
};

TEST(SessionStore, WhoWaitsForTheRecordHearsOfItOnce) {
  for (const bool fails : {false, true}) {
    SessionStore store({});
    SessionOptions options = Options();
    const auto journal = std::make_shared<LateJournal>();
    store.RecordIn([journal] { return journal; });
    const auto session = *store.Create(std::move(options));
    Occasion& recorded = *session->ports().recorded;
    std::promise<void> heard;  // throws the second time
    recorded.Then([&heard] { heard.set_value(); });
    EXPECT_FALSE(recorded.HasHappened());
    std::optional<MeshFailure> failure;
    if (fails) failure = MeshFailure{FailureReason::kJournalFull, "full"};
    journal->gate.set_value(failure);
    heard.get_future().wait();
    EXPECT_TRUE(recorded.HasHappened());
    EXPECT_EQ(session->View().state == SessionState::kFailed, fails);
    bool now = false;
    recorded.Then([&now] { now = true; });
    EXPECT_TRUE(now) << "it has happened";
  }
}

// A mesher that asks for one point, and is not destroyed before the test says so.
class SlowToGo : public stellate::testing::StubMesher {
 public:
  SlowToGo(core::Specification spec, std::shared_future<void> gate)
      : StubMesher(std::move(spec)), gate_(std::move(gate)) {}
  ~SlowToGo() override { gate_.wait(); }

  std::shared_ptr<const core::QueryBatch> NextBatch() override {
    return IsOver() ? nullptr : batch_;
  }
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
                     [future = gate.get_future().share()](core::Specification spec, core::Execution)
                         -> core::Expected<std::unique_ptr<core::Mesher>> {
                       return std::make_unique<SlowToGo>(std::move(spec), future);
                     });
  const auto budget = std::make_shared<MemoryBudget>(MemoryBudget::Limits{});
  std::vector<std::shared_ptr<Session>> ended;
  for (std::size_t i = 0; i < kMostEnding; ++i) {
    SessionOptions options = Options();
    options.ports.memory = MemoryBudget::Open(budget, "");
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

TEST(SessionStore, AMeshWithoutAThreadIsRefusedAndTheNextOneIsNot) {
  SessionStore store({});
  {
    const testing::NoMoreThreads none;
    const auto refused = store.Create(Options());
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, core::StatusCode::kLimitExceeded);
    EXPECT_NE(refused.error().message.find("thread"), std::string::npos);
  }
  EXPECT_EQ(store.List(0, 10, "").sessions.size(), 0u);
  EXPECT_TRUE(store.Create(Options()));
}

TEST(SessionStore, HoldsEachNamedOwnerToItsShare) {
  SessionStore store({4, 10, 1h, 1});
  const auto create = [&store](const std::string& owner) {
    SessionOptions options = Options();
    options.request.owner = owner;
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

// A mesher that has a given number of vertices at once, and then asks for more until it is
// cancelled.
class Founded : public stellate::testing::StubMesher {
 public:
  Founded(core::Specification spec, std::uint64_t vertices) : StubMesher(std::move(spec)) {
    progress_.vertices = vertices;
  }

  std::shared_ptr<const core::QueryBatch> NextBatch() override {
    return IsOver() ? nullptr : batch_;
  }
  core::Expected<core::MeshDelta> Absorb(const core::Answers&) override {
    return core::Refuse(core::StatusCode::kCancelled, "never asked");
  }
};

class SweepTest : public ::testing::Test {
 protected:
  static constexpr std::size_t kKept = 2;

  // Of a mesh that has been cancelled.
  std::string Finished(const std::string& owner, bool with_vertices = true) {
    SessionOptions options = Options();
    options.request.owner = owner;
    options.request.spec.epsilon = with_vertices ? 0.3 : kBarren;
    const auto session = *store_.Create(std::move(options));
    while (with_vertices && !session->HasVertices()) std::this_thread::sleep_for(1ms);
    session->Cancel();
    WaitUntilOver(*session);
    return session->request().name;
  }
  std::vector<std::string> Several(std::size_t count, const std::string& owner,
                                   bool with_vertices = true) {
    std::vector<std::string> names;
    while (names.size() < count) names.push_back(Finished(owner, with_vertices));
    return names;
  }
  std::size_t Kept(const std::vector<std::string>& names) const {
    return std::count_if(names.begin(), names.end(),
                         [this](const std::string& name) { return store_.Find(name) != nullptr; });
  }

  static constexpr double kBarren = 0.2;  // an epsilon that gives no vertices
  const TimePoint now_ = Clock::now();
  SessionStore store_{{100, kKept, 1h},
                      [](core::Specification spec,
                         core::Execution) -> core::Expected<std::unique_ptr<core::Mesher>> {
                        const std::uint64_t vertices = spec.epsilon == kBarren ? 0 : 3;
                        return std::make_unique<Founded>(std::move(spec), vertices);
                      }};
};

TEST_F(SweepTest, OneOwnersMeshesPushOutNoneOfAnothers) {
  const std::string result = Finished("alice");
  store_.Sweep(now_);
  const auto flood = Several(33, "mallory");
  store_.Sweep(now_ + 2min);
  store_.Sweep(now_ + 4min);
  EXPECT_NE(store_.Find(result), nullptr);
  EXPECT_EQ(Kept(flood), kKept) << "what they push out is their own";
}

TEST_F(SweepTest, TheOldestGoButNoneWithinAMinuteOfItsEnd) {
  const auto names = Several(4, "alice");
  store_.Sweep(now_);
  store_.Sweep(now_ + 59s);
  EXPECT_EQ(Kept(names), 4u);
  store_.Sweep(now_ + 60s);
  EXPECT_EQ(store_.Find(names[0]), nullptr);
  EXPECT_EQ(store_.Find(names[1]), nullptr);
  EXPECT_NE(store_.Find(names[2]), nullptr);
  store_.Sweep(now_ + 1h);
  EXPECT_EQ(Kept(names), 0u);
}

TEST_F(SweepTest, WhatHasNoVertexGoesFirstAndAtOnce) {
  for (const std::string owner : {"alice", ""}) {
    const std::string result = Finished(owner);
    store_.Sweep(now_);
    const auto flood = Several(33, owner, /*with_vertices=*/false);
    store_.Sweep(now_ + 10min);
    EXPECT_NE(store_.Find(result), nullptr) << "owner \"" << owner << "\"";
    EXPECT_EQ(Kept(flood), kKept - 1) << "owner \"" << owner << "\"";
  }
}

TEST_F(SweepTest, ARunningMeshStays) {
  const auto running = *store_.Create(Options());
  store_.Sweep(now_ + 2h);
  EXPECT_NE(store_.Find(running->request().name), nullptr);
}

// Remembers how the mesh ended.
class EndJournal : public testing::BlankJournal {
 public:
  std::optional<MeshFailure> WriteEnd(const SessionEnd& written) override {
    end = written;
    return std::nullopt;
  }

  std::optional<SessionEnd> end;
};

class ClockSetBackTest : public ::testing::Test {
 protected:
  // A mesh that an earlier server recorded when its clock was two hours fast.
  std::shared_ptr<Session> Restore(std::optional<SessionEnd> end) {
    SessionOptions options = Options();
    options.request.name = NewMeshName();
    options.ports.journal = journal_;
    options.record = SessionRecord{created_, 0, {}, std::move(end), {}};
    const std::string name = options.request.name;
    store_.Restore(std::move(options));
    return store_.Find(name);
  }

  const std::chrono::system_clock::time_point created_ = std::chrono::system_clock::now() + 2h;
  const std::shared_ptr<EndJournal> journal_ = std::make_shared<EndJournal>();
  SessionStore store_{{}};
};

TEST_F(ClockSetBackTest, AMeshEndsNotBeforeItBegan) {
  const auto session = Restore(std::nullopt);
  ASSERT_NE(session, nullptr);
  EXPECT_GE(session->View().elapsed_seconds, 0);
  session->Cancel();
  WaitUntilOver(*session);
  const SessionView view = session->View();
  EXPECT_GE(view.elapsed_seconds, 0);
  EXPECT_LT(view.elapsed_seconds, 3600);
  EXPECT_GE(*view.end_time, view.create_time);
  ASSERT_TRUE(journal_->end);
  EXPECT_GE(journal_->end->time, created_) << "on the disk as well";
  EXPECT_GE(journal_->end->elapsed_seconds, 0);
}

TEST_F(ClockSetBackTest, ARecordWithNegativeTimesIsReadWithoutThem) {
  const auto session = Restore(SessionEnd{SessionState::kCancelled, created_ - 1h, -3600, {}, 0});
  ASSERT_NE(session, nullptr);
  WaitUntilOver(*session);
  const SessionView view = session->View();
  EXPECT_EQ(view.elapsed_seconds, 0);
  EXPECT_GE(*view.end_time, view.create_time);
  store_.Sweep(Clock::now() + 59min);
  EXPECT_NE(store_.Find(session->request().name), nullptr) << "kept from now on";
  store_.Sweep(Clock::now() + 61min);
  EXPECT_EQ(store_.Find(session->request().name), nullptr);
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
