#include "server/session/mesh_spans.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "server/session/session.h"
#include "tests/server/support/fake_worker.h"
#include "tests/server/support/sphere.h"

namespace stellate::server {
namespace {

using namespace std::chrono_literals;
using testing::FakeWorker;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using testing::SphereSpec;

constexpr char kName[] = "meshes/0af7651916cd43dd8448eb211c80319c";
constexpr char kParent[] = "00-11111111111111111111111111111111-2222222222222222-01";
constexpr char kOtherParent[] = "00-33333333333333333333333333333333-4444444444444444-01";

class Sink final : public SpanSink {
 public:
  void Take(std::vector<Span> spans) override {
    const std::lock_guard lock(mutex_);
    for (Span& span : spans) spans_.push_back(std::move(span));
  }
  std::vector<Span> All() {
    const std::lock_guard lock(mutex_);
    return spans_;
  }
  std::vector<Span> Named(const std::string& name) {
    std::vector<Span> some = All();
    std::erase_if(some, [&](const Span& span) { return span.name != name; });
    return some;
  }
  Span Only(const std::string& name) {
    const std::vector<Span> some = Named(name);
    EXPECT_EQ(some.size(), 1u) << name;
    return some.empty() ? Span() : some[0];
  }

 private:
  std::mutex mutex_;
  std::vector<Span> spans_;
};

template <typename T>
T Of(const Span& span, const std::string& key) {
  for (const auto& [name, value] : span.attributes) {
    if (name == key) return std::get<T>(value);
  }
  ADD_FAILURE() << span.name << " has no " << key;
  return T();
}

MeshRequest SphereRequest(const TraceHeaders& trace = {}) {
  MeshRequest request;
  request.name = kName;
  request.owner = "ann";
  request.label = "a sphere";
  request.spec = SphereSpec(0.3);
  request.trace = trace;
  return request;
}

// A session on its own thread, whose spans go into a sink.
struct Spanned {
  explicit Spanned(MeshRequest request, std::shared_ptr<SpanSink> to) {
    SessionOptions options;
    options.request = std::move(request);
    options.ports.spans = std::move(to);
    session = std::make_shared<Session>(options);
    thread = std::thread([s = session] { s->Run(); });
  }
  ~Spanned() {
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

SessionView MeshSphere(const std::shared_ptr<Sink>& sink, const TraceHeaders& trace = {}) {
  Spanned running(SphereRequest(trace), sink);
  const auto worker = FakeWorker::Join(&running.session->pool());
  return running.Finish();
}

TEST(MeshSpans, NestAsWhatTheyTellOf) {
  const auto sink = std::make_shared<Sink>();
  const SessionView view = MeshSphere(sink);
  ASSERT_EQ(view.state, SessionState::kSucceeded);
  const Span mesh = sink->Only("mesh");
  EXPECT_EQ(mesh.above.span, SpanId{}) << "nothing is above it";
  EXPECT_EQ(mesh.above.trace, TraceOfMesh(kName)) << "the trace is found by the mesh's name";
  std::map<SpanId, Span> by_id;
  for (const Span& span : sink->All()) {
    EXPECT_TRUE(by_id.emplace(span.id, span).second) << "ids differ";
    EXPECT_EQ(span.above.trace, mesh.above.trace);
    EXPECT_LE(span.start, span.end);
  }
  const std::map<std::string, std::string> above = {{"round", "mesh"}, {"worker", "mesh"},
                                                    {"plan", "round"}, {"ask", "round"},
                                                    {"chunk", "ask"},  {"absorb", "round"}};
  for (const auto& [id, span] : by_id) {
    if (span.name == "mesh") continue;
    ASSERT_TRUE(by_id.contains(span.above.span)) << span.name;
    const Span& parent = by_id.at(span.above.span);
    EXPECT_EQ(parent.name, above.at(span.name));
    EXPECT_GE(span.start, parent.start) << span.name;
    EXPECT_LE(span.end, parent.end) << span.name;
  }
}

TEST(MeshSpans, TellEachRoundInTheOrderOfWhatItDid) {
  const auto sink = std::make_shared<Sink>();
  const SessionView view = MeshSphere(sink);
  const std::vector<Span> rounds = sink->Named("round");
  ASSERT_EQ(rounds.size(), view.progress.round);
  std::int64_t queries = 0;
  for (std::size_t i = 0; i < rounds.size(); ++i) {
    EXPECT_EQ(Of<std::int64_t>(rounds[i], "stellate.round"), static_cast<std::int64_t>(i + 1));
    queries += Of<std::int64_t>(rounds[i], "stellate.queries");
    if (i > 0) {
      EXPECT_GE(rounds[i].start, rounds[i - 1].end);
    }
    std::vector<Span> steps = sink->All();
    std::erase_if(steps, [&](const Span& s) { return s.above.span != rounds[i].id; });
    ASSERT_EQ(steps.size(), 3u);
    EXPECT_EQ(steps[0].name, "plan");
    EXPECT_EQ(steps[1].name, "ask");
    EXPECT_EQ(steps[2].name, "absorb");
    EXPECT_EQ(steps[0].start, rounds[i].start);
    EXPECT_EQ(steps[1].start, steps[0].end);
    EXPECT_EQ(steps[2].start, steps[1].end);
    EXPECT_GE(Of<std::int64_t>(rounds[i], "stellate.chunks"), 1);
    EXPECT_GE(Of<double>(rounds[i], "stellate.waited_seconds"), 0);
  }
  EXPECT_EQ(queries, static_cast<std::int64_t>(view.progress.queries));
}

TEST(MeshSpans, SayWhatTheMeshIsAndBecame) {
  const auto sink = std::make_shared<Sink>();
  const SessionView view = MeshSphere(sink);
  const Span mesh = sink->Only("mesh");
  EXPECT_EQ(Of<std::string>(mesh, "stellate.mesh"), kName);
  EXPECT_EQ(Of<std::string>(mesh, "stellate.owner"), "ann");
  EXPECT_EQ(Of<std::string>(mesh, "stellate.label"), "a sphere");
  EXPECT_EQ(Of<double>(mesh, "stellate.epsilon"), 0.3);
  EXPECT_EQ(Of<std::string>(mesh, "stellate.state"), "SUCCEEDED");
  EXPECT_TRUE(Of<bool>(mesh, "stellate.certified"));
  EXPECT_FALSE(Of<bool>(mesh, "stellate.resumed"));
  EXPECT_EQ(Of<std::int64_t>(mesh, "stellate.vertices"),
            static_cast<std::int64_t>(view.progress.vertices));
  EXPECT_EQ(Of<std::int64_t>(mesh, "stellate.workers"), 1);
  EXPECT_FALSE(mesh.error);
  const Span worker = sink->Only("worker");
  EXPECT_GE(Of<std::int64_t>(worker, "stellate.queries"),
            static_cast<std::int64_t>(view.progress.queries));
}

TEST(MeshSpans, GoOnWithTheTraceOfTheClient) {
  const auto sink = std::make_shared<Sink>();
  MeshSphere(sink, {kParent, "vendor=1"});
  const TraceContext client = *ReadTraceContext({kParent, ""});
  const Span mesh = sink->Only("mesh");
  EXPECT_EQ(mesh.above.span, client.span);
  EXPECT_TRUE(mesh.is_remote);
  for (const Span& span : sink->All()) {
    EXPECT_EQ(span.above.trace, client.trace);
    EXPECT_EQ(span.above.state, "vendor=1");
  }
}

TEST(MeshSpans, ThereAreNoneOfATraceThatIsNotSampled) {
  const auto sink = std::make_shared<Sink>();
  std::string parent = kParent;
  parent.back() = '0';
  EXPECT_EQ(MeshSphere(sink, {parent, ""}).state, SessionState::kSucceeded);
  EXPECT_TRUE(sink->All().empty());
}

TEST(MeshSpans, ChangeNothingOfTheMesh) {
  const SessionView with = MeshSphere(std::make_shared<Sink>());
  const SessionView without = MeshSphere(nullptr);
  EXPECT_EQ(with.revision, without.revision);
  EXPECT_EQ(with.progress.queries, without.progress.queries);
  EXPECT_EQ(with.progress.vertices, without.progress.vertices);
}

TEST(MeshSpans, OfAMeshThatFailsSayWhy) {
  const auto sink = std::make_shared<Sink>();
  MeshRequest request = SphereRequest();
  request.timeouts.worker_wait = 1ms;
  Spanned running(std::move(request), sink);
  ASSERT_EQ(running.Finish().state, SessionState::kFailed);
  const Span mesh = sink->Only("mesh");
  EXPECT_EQ(Of<std::string>(mesh, "stellate.state"), "FAILED");
  EXPECT_EQ(Of<std::string>(mesh, "stellate.reason"), "NO_WORKER");
  EXPECT_THAT(mesh.error.value_or(""), HasSubstr("no worker served the mesh"));
  EXPECT_EQ(sink->Only("round").error, mesh.error) << "the round that failed it";
}

TEST(MeshSpans, OfAMeshThatIsCancelledAreNoErrors) {
  const auto sink = std::make_shared<Sink>();
  Spanned running(SphereRequest(), sink);
  running.session->Cancel();
  ASSERT_EQ(running.Finish().state, SessionState::kCancelled);
  EXPECT_EQ(Of<std::string>(sink->Only("mesh"), "stellate.state"), "CANCELLED");
  for (const Span& span : sink->All()) EXPECT_FALSE(span.error) << span.name;
}

TEST(MeshSpans, AWorkerThatLeavesItsChunksIsAnErrorOfTheirs) {
  const auto sink = std::make_shared<Sink>();
  Spanned running(SphereRequest(), sink);
  auto dead = FakeWorker::Join(&running.session->pool(),
                               [](const Chunk&, core::AnswerBlock*) { return false; });
  dead->WaitForChunks(1);
  dead->Leave();
  const auto worker = FakeWorker::Join(&running.session->pool());
  ASSERT_EQ(running.Finish().state, SessionState::kSucceeded);
  std::vector<Span> lost = sink->Named("chunk");
  std::erase_if(lost, [](const Span& span) { return !span.error; });
  ASSERT_FALSE(lost.empty());
  for (const Span& chunk : lost) {
    EXPECT_EQ(Of<std::int64_t>(chunk, "stellate.worker"), 1);
    EXPECT_EQ(Of<std::string>(chunk, "stellate.outcome"), "worker left");
  }
}

// The rest is told to the spans themselves, in times of the test's own.
class TellMeshSpans : public ::testing::Test {
 protected:
  MeshSpans::Ending Ending() const { return {"SUCCEEDED", failure_, report_, progress_}; }
  void Ask(LeaseId id, WorkerId worker, Clock::duration ago) {
    Lease lease;
    lease.id = id;
    lease.worker = worker;
    lease.count = 10;
    lease.sent = Clock::now() - ago;
    spans_.OnAsked(lease);
  }
  std::set<std::int64_t> KeptWorkers() {
    std::set<std::int64_t> kept;
    for (const Span& chunk : sink_->Named("chunk")) {
      kept.insert(Of<std::int64_t>(chunk, "stellate.worker"));
    }
    return kept;
  }

  const std::shared_ptr<Sink> sink_ = std::make_shared<Sink>();
  MeshSpans spans_{sink_, SphereRequest(), "mesh", false};
  core::QueryBatch batch_;
  MeshFailure failure_;
  core::Report report_;
  core::Progress progress_;
};

TEST_F(TellMeshSpans, OfARoundTheChunksThatMatterMostAreKept) {
  spans_.BeginRound(batch_, Clock::now());
  for (LeaseId id = 1; id <= 1000; ++id) {
    const bool is_slow = id % 200 == 0;
    Ask(id, id, is_slow ? 1h : 1min);
    if (id % 300 != 0) spans_.OnAnswered(id, Dispatch::AcceptResult::kCounts);
  }
  spans_.Step("ask");
  spans_.EndRound();
  EXPECT_EQ(sink_->Named("chunk").size(), MeshSpans::kMostChunks);
  EXPECT_EQ(Of<std::int64_t>(sink_->Only("round"), "stellate.chunks"), 1000);
  EXPECT_THAT(KeptWorkers(), IsSupersetOf({300, 600, 900})) << "without an answer";
  EXPECT_THAT(KeptWorkers(), IsSupersetOf({200, 400, 800, 1000})) << "slow";
}

TEST_F(TellMeshSpans, AnAnswerEndsOnlyAChunkOfThisRound) {
  spans_.BeginRound(batch_, Clock::now());
  Ask(1, 1, 0s);
  spans_.EndRound();
  spans_.OnAnswered(1, Dispatch::AcceptResult::kLate);  // between two rounds
  spans_.BeginRound(batch_, Clock::now());
  spans_.OnAnswered(1, Dispatch::AcceptResult::kLate);
  Ask(2, 1, 0s);
  spans_.OnAnswered(2, Dispatch::AcceptResult::kUnknown);
  spans_.OnAnswered(2, Dispatch::AcceptResult::kForComparison);
  spans_.EndRound();
  const std::vector<Span> chunks = sink_->Named("chunk");
  ASSERT_EQ(chunks.size(), 2u);
  EXPECT_EQ(Of<std::string>(chunks[0], "stellate.outcome"), "no answer");
  EXPECT_EQ(Of<std::string>(chunks[1], "stellate.outcome"), "compared");
}

TEST_F(TellMeshSpans, OfManyRoundsThoseAreKeptThatTakeLong) {
  const std::uint64_t more = MeshSpans::kMostRounds + 200;
  for (std::uint64_t i = 0; i < more; ++i) {
    spans_.BeginRound(batch_, Clock::now());
    spans_.EndRound();
  }
  spans_.BeginRound(batch_, Clock::now() - MeshSpans::kLongRound);
  spans_.EndRound();
  spans_.End(Ending());
  EXPECT_LE(sink_->Named("round").size(), more) << "some were left out";
  EXPECT_GE(sink_->Named("round").size(), MeshSpans::kMostRounds + 1);
  const Span last = sink_->Named("round").back();
  EXPECT_GE(last.end - last.start, MeshSpans::kLongRound);
  EXPECT_EQ(Of<std::int64_t>(sink_->Only("mesh"), "stellate.rounds_left_out"),
            static_cast<std::int64_t>(more + 1 - sink_->Named("round").size()));
}

TEST_F(TellMeshSpans, AWorkersSpanIsOfItsOwnTraceAndNamesTheMeshs) {
  spans_.OnJoined(1, "gpu at 10.0.0.1", {kOtherParent, ""});
  spans_.OnLeft(1);
  spans_.End(Ending());
  const Span worker = sink_->Only("worker"), mesh = sink_->Only("mesh");
  const TraceContext own = *ReadTraceContext({kOtherParent, ""});
  EXPECT_EQ(worker.above.trace, own.trace);
  EXPECT_EQ(worker.above.span, own.span);
  ASSERT_TRUE(worker.other);
  EXPECT_EQ(worker.other->trace, mesh.above.trace);
  EXPECT_EQ(worker.other->span, mesh.id);
  EXPECT_EQ(Of<std::string>(worker, "stellate.worker_name"), "gpu at 10.0.0.1");
}

TEST_F(TellMeshSpans, AWorkerWhoseTraceIsNotSampledHasNoSpan) {
  std::string parent = kOtherParent;
  parent.back() = '0';
  spans_.OnJoined(1, "", {parent, ""});
  spans_.OnLeft(1);
  EXPECT_TRUE(sink_->All().empty());
}

TEST_F(TellMeshSpans, WorkersThatComeAndGoAreCounted) {
  for (WorkerId id = 1; id <= 1000; ++id) {
    spans_.OnJoined(id, "", {});
    spans_.OnLeft(id);
    spans_.OnLeft(id);
  }
  spans_.End(Ending());
  EXPECT_EQ(sink_->Named("worker").size(), MeshSpans::kMostWorkers);
  EXPECT_EQ(Of<std::int64_t>(sink_->Only("mesh"), "stellate.workers"), 1000);
}

TEST_F(TellMeshSpans, ARoundThatAnExceptionEndedEndsWithTheMesh) {
  spans_.BeginRound(batch_, Clock::now());
  failure_ = {FailureReason::kInternal, "a fault " + std::string(5000, 'x')};
  spans_.End(Ending());
  EXPECT_EQ(sink_->Only("round").error, sink_->Only("mesh").error);
  EXPECT_LE(sink_->Only("mesh").error->size(), 1100u);
}

}  // namespace
}  // namespace stellate::server
