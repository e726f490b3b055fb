#include "server/session/session.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <stdexcept>
#include <thread>

#include "tests/server/support/fake_worker.h"
#include "tests/server/support/sphere.h"
#include "tests/support/stub_mesher.h"

namespace stellate::server {
namespace {

using namespace std::chrono_literals;
using testing::FakeWorker;
using testing::SphereSpec;

// A mesher that asks one point a round and adds it, as told by the test.
class FakeMesher : public stellate::testing::StubMesher {
 public:
  struct Plan {
    int rounds = 3;
    core::Status absorb_error;        // not Ok: Absorb refuses
    std::uint64_t error_after = 0;    // rounds
    bool throws = false;              // Absorb throws
    std::uint64_t revision_step = 1;  // 2: deltas that do not follow
    std::shared_future<void> gate;    // Absorb waits for it, or to be interrupted
    bool foreseeable = false;         // a half of the work is done, as far as is known
  };

  FakeMesher(core::Specification spec, Plan plan)
      : StubMesher(std::move(spec)), plan_(std::move(plan)) {
    batch_->blocks[0].want.tangents = true;
  }

  std::shared_ptr<const core::QueryBatch> NextBatch() override {
    if (progress_.round == static_cast<std::uint64_t>(plan_.rounds)) {
      End(core::Termination::kConverged);
    }
    batch_->round = progress_.round + 1;
    return IsOver() ? nullptr : batch_;
  }

  core::Expected<core::MeshDelta> Absorb(const core::Answers& answers) override {
    while (plan_.gate.valid() && plan_.gate.wait_for(1ms) != std::future_status::ready) {
      if (interrupted_) return core::Refuse(core::StatusCode::kCancelled, "interrupted");
    }
    if (plan_.throws) throw std::runtime_error("boom");
    if (!plan_.absorb_error.ok() && progress_.round >= plan_.error_after)
      return tl::unexpected(plan_.absorb_error);
    ++progress_.round;
    progress_.fraction = 0.5;
    progress_.is_foreseeable = plan_.foreseeable;
    core::MeshDelta delta;
    delta.revision = progress_.round * plan_.revision_step;
    delta.first_vertex = progress_.vertices;
    delta.points = answers.blocks[0].points;
    progress_.vertices += 1;
    return delta;
  }

  void Interrupt() override { interrupted_ = true; }

 private:
  const Plan plan_;
  std::atomic<bool> interrupted_ = false;
};

Session::MesherFactory Faking(FakeMesher::Plan plan) {
  return [plan](core::Specification spec,
                core::Execution) -> core::Expected<std::unique_ptr<core::Mesher>> {
    return std::make_unique<FakeMesher>(std::move(spec), plan);
  };
}

// A session on its own thread.
struct Running {
  explicit Running(Session::MesherFactory factory = core::Mesher::Create, double epsilon = 0.3,
                   Clock::duration worker_wait = 60s) {
    SessionOptions options;
    options.request.name = "meshes/00000000000000000000000000000000";
    options.request.spec = SphereSpec(epsilon);
    options.request.timeouts.worker_wait = worker_wait;
    options.policy.max_watchers = 2;
    session = std::make_shared<Session>(options, std::move(factory));
    thread = std::thread([s = session] { s->Run(); });
  }
  ~Running() {
    session->Cancel();
    if (thread.joinable()) thread.join();
  }
  SessionView Finish() {
    thread.join();
    return session->View();
  }

  std::shared_ptr<Session> session;
  std::thread thread;
};

TEST(Session, RunsAllRoundsAndKeepsTheirHistory) {
  Running running(Faking({}));
  const auto worker = FakeWorker::Join(&running.session->pool());
  const SessionView view = running.Finish();
  EXPECT_EQ(view.state, SessionState::kSucceeded);
  EXPECT_EQ(view.revision, 3u);
  EXPECT_EQ(view.progress.vertices, 3u);
  EXPECT_TRUE(view.report.has_value());
  EXPECT_TRUE(view.end_time.has_value());
  EXPECT_TRUE(running.session->HasEnded());
  worker->WaitForEnd();
  EXPECT_TRUE(worker->end().blame.ok());
}

TEST(Session, WaitsWithoutAWorkerAndThenGivesUp) {
  Running running(Faking({}), 0.3, 30ms);
  EXPECT_FALSE(running.session->View().report.has_value());
  const SessionView view = running.Finish();
  EXPECT_EQ(view.state, SessionState::kFailed);
  EXPECT_EQ(view.failure.reason, FailureReason::kNoWorker);
}

TEST(Session, CancelEndsAWaitAtOnce) {
  Running running(Faking({}));
  EXPECT_EQ(running.session->View().state, SessionState::kWaiting);
  running.session->Cancel();
  EXPECT_EQ(running.session->View().state, SessionState::kCancelled);
  EXPECT_EQ(running.Finish().state, SessionState::kCancelled);
}

// The gate never opens: only an interruption ends the round.
TEST(Session, CancelInterruptsARoundThatIsBeingComputed) {
  std::promise<void> gate;
  FakeMesher::Plan plan;
  plan.gate = gate.get_future().share();
  Running running(Faking(plan));
  const auto worker = FakeWorker::Join(&running.session->pool());
  running.session->Cancel();
  EXPECT_EQ(running.session->View().state, SessionState::kCancelled);
  const SessionView view = running.Finish();
  EXPECT_EQ(view.state, SessionState::kCancelled);
  EXPECT_EQ(view.revision, 0u);
}

TEST(Session, AnswersThatTheMesherRefusesFailTheMeshAndBlameItsWorkers) {
  FakeMesher::Plan plan;
  plan.absorb_error = {core::StatusCode::kOracleNotIdempotent, "query 5 moves its own answer"};
  Running running(Faking(plan));
  const auto worker = FakeWorker::Join(&running.session->pool());
  const SessionView view = running.Finish();
  EXPECT_EQ(view.state, SessionState::kFailed);
  EXPECT_EQ(view.failure.reason, FailureReason::kOracleNotIdempotent);
  EXPECT_EQ(view.failure.message, "query 5 moves its own answer");
  worker->WaitForEnd();
  EXPECT_EQ(worker->end().blame.code, core::StatusCode::kOracleNotIdempotent);
}

// Answers that contradict each other may be two workers', of whom each is right.
TEST(Session, ARefusalSaysIfSeveralWorkersAnswered) {
  for (const bool are_two : {false, true}) {
    FakeMesher::Plan plan;
    plan.absorb_error = {core::StatusCode::kOracleBadConormal, "turned"};
    plan.error_after = 1;
    std::promise<void> gate;
    plan.gate = gate.get_future().share();
    Running running(Faking(plan));
    const auto first = FakeWorker::Join(&running.session->pool());
    const auto second = are_two ? FakeWorker::Join(&running.session->pool()) : nullptr;
    gate.set_value();
    const SessionView view = running.Finish();
    EXPECT_EQ(view.failure.reason, FailureReason::kOracleBadConormal);
    EXPECT_EQ(view.failure.message,
              are_two ? "turned; 2 workers have answered: if each is right by itself, they serve "
                        "different manifolds"
                      : "turned");
  }
}

TEST(Session, AFaultOfTheMesherFailsOnlyItsMesh) {
  FakeMesher::Plan throwing;
  throwing.throws = true;
  FakeMesher::Plan skipping;
  skipping.revision_step = 2;
  for (const auto& plan : {throwing, skipping}) {
    Running running(Faking(plan));
    const auto worker = FakeWorker::Join(&running.session->pool());
    const SessionView view = running.Finish();
    EXPECT_EQ(view.state, SessionState::kFailed);
    EXPECT_EQ(view.failure.reason, FailureReason::kInternal);
    worker->WaitForEnd();
    EXPECT_TRUE(worker->end().blame.ok()) << "it is not the oracle's fault";
  }
}

TEST(Session, AMeshThatOutgrowsTheMemoryFailsAndGivesItBack) {
  SessionOptions options;
  options.request.name = "meshes/00000000000000000000000000000000";
  options.request.spec = SphereSpec(0.3);
  // The first two rounds end with one vertex and two; a third would be too much.
  const auto budget = std::make_shared<MemoryBudget>(
      MemoryBudget::Limits{EstimateMeshBytes(options.request.spec, 1, 1), 0});
  options.ports.memory = MemoryBudget::Open(budget, "");
  Session session(options, Faking({}));
  std::thread thread([&session] { session.Run(); });
  const auto worker = FakeWorker::Join(&session.pool());
  thread.join();
  const SessionView view = session.View();
  EXPECT_EQ(view.state, SessionState::kFailed);
  EXPECT_EQ(view.failure.reason, FailureReason::kLimitExceeded);
  EXPECT_NE(view.failure.message.find("--max-memory-bytes"), std::string::npos);
  EXPECT_EQ(view.revision, 2u);
  EXPECT_EQ(view.bytes, EstimateFinishedBytes(session.request().spec) +
                            session.history().loaded()->MemoryBytes())
      << "the mesher is gone";
  EXPECT_EQ(budget->total(), view.bytes);
  worker->WaitForEnd();
  EXPECT_TRUE(worker->end().blame.ok());
}

TEST(Session, ARefusedSpecificationFailsTheMesh) {
  Running running(
      [](core::Specification, core::Execution) -> core::Expected<std::unique_ptr<core::Mesher>> {
        return core::Refuse(core::StatusCode::kInvalidArgument, "epsilon is wrong");
      });
  const SessionView view = running.Finish();
  EXPECT_EQ(view.state, SessionState::kFailed);
  EXPECT_EQ(view.failure.reason, FailureReason::kInvalidArgument);
}

struct CountingWatcher : SessionWatcher {
  void Wake() override { ++wakes; }
  std::atomic<int> wakes{0};
};

TEST(Session, WatchersAreWokenEachRoundAndBounded) {
  Running running(Faking({}));
  auto first = std::make_shared<CountingWatcher>();
  auto second = std::make_shared<CountingWatcher>();
  EXPECT_TRUE(running.session->history().AddWatcher(first));
  EXPECT_TRUE(running.session->history().AddWatcher(second));
  EXPECT_FALSE(running.session->history().AddWatcher(std::make_shared<CountingWatcher>()));
  second.reset();
  EXPECT_EQ(running.session->View().watchers, 1u);
  const auto worker = FakeWorker::Join(&running.session->pool());
  running.Finish();
  EXPECT_GE(first->wakes, 3);
}

TEST(Session, WhatARoundLedToIsShownBeforeTheNextIsAnswered) {
  Running running(Faking({}));
  std::atomic<int> seen{0};
  const auto worker = FakeWorker::Join(
      &running.session->pool(), [&](const Chunk& chunk, core::AnswerBlock* answer) {
        const TimePoint patience = Clock::now() + 60s;
        while (running.session->history().loaded()->revision() + 1 < chunk.round->batch->round) {
          if (Clock::now() > patience) return false;
          std::this_thread::sleep_for(1ms);
        }
        ++seen;
        return FakeWorker::AnswerTruly(chunk, answer);
      });
  EXPECT_EQ(running.Finish().revision, 3u);
  EXPECT_EQ(seen, 3);
}

TEST(Session, TheTimeLeftIsToldOnlyWhereItIsKnown) {
  for (const bool foreseeable : {true, false}) {
    FakeMesher::Plan plan;
    plan.foreseeable = foreseeable;
    Running running(Faking(plan));
    SessionView meanwhile;
    const auto worker = FakeWorker::Join(&running.session->pool(),
                                         [&](const Chunk& chunk, core::AnswerBlock* answer) {
                                           if (chunk.round->batch->round == 3)
                                             meanwhile = running.session->View();
                                           return FakeWorker::AnswerTruly(chunk, answer);
                                         });
    running.Finish();
    EXPECT_EQ(meanwhile.progress.fraction, 0.5);
    EXPECT_GT(meanwhile.elapsed_seconds, 0);
    EXPECT_EQ(meanwhile.remaining_seconds, foreseeable ? meanwhile.elapsed_seconds : 0);
    EXPECT_EQ(running.session->View().remaining_seconds, 0) << "it is over";
  }
}

// The real mesher, and workers that answer for the sphere.
std::vector<double> MeshSphere(int workers, std::vector<std::uint32_t>* simplices) {
  Running running;
  std::vector<std::shared_ptr<FakeWorker>> joined;
  for (int i = 0; i < workers; ++i) joined.push_back(FakeWorker::Join(&running.session->pool()));
  const SessionView view = running.Finish();
  EXPECT_EQ(view.state, SessionState::kSucceeded);
  EXPECT_TRUE(view.report->certificate.certified) << view.report->certificate.verdict;
  EXPECT_EQ(view.report->certificate.euler_characteristic, 2);
  const MeshHistory& history = *running.session->history().loaded();
  MeshHistory::Cursor cursor = history.Begin(0);
  std::vector<double> points;
  for (DeltaPart part; !part.complete;) {
    part = history.Next(&cursor, 1 << 20);
    points.insert(points.end(), part.points.begin(), part.points.end());
    simplices->insert(simplices->end(), part.added.begin(), part.added.end());
  }
  EXPECT_EQ(points.size(), 3 * view.report->counts.vertices);
  EXPECT_EQ(simplices->size(), 3 * view.report->counts.simplices);
  return points;
}

TEST(Session, OneAndFourWorkersGiveTheSameMesh) {
  std::vector<std::uint32_t> from_one, from_four;
  const auto one = MeshSphere(1, &from_one);
  const auto four = MeshSphere(4, &from_four);
  EXPECT_EQ(one, four);
  EXPECT_EQ(from_one, from_four);
}

}  // namespace
}  // namespace stellate::server
