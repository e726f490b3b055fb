// Whole meshes, and the servers that they outlive.

#include "core/base/message.h"
#include "tests/server/support/blank_journal.h"
#include "tests/server/support/journal_fixture.h"

namespace stellate::server {
namespace {

using testing::ExpectSame;
using testing::FakeWorker;
using testing::JournalTest;
using testing::Outcome;
using testing::RecordedSphere;
using testing::RunMesh;

TEST_F(JournalTest, AMeshStoppedAgainAndAgainIsTheUndisturbedOne) {
  const Outcome whole = RunMesh(RecordedSphere(nullptr));
  ASSERT_EQ(whole.view.state, SessionState::kSucceeded);
  ASSERT_GT(whole.view.revision, 6u);
  {
    const auto journal = Open();
    RunMesh(RecordedSphere(journal->NewMesh()), 1);
  }
  std::uint64_t before = 0;
  for (const std::uint64_t stop_at : {3, 5}) {
    const auto journal = Open();
    auto meshes = journal->TakeMeshes();
    ASSERT_EQ(meshes.size(), 1u);
    EXPECT_FALSE(meshes[0].record->end) << "a stop of the server is no end";
    EXPECT_GE(meshes[0].record->rounds, before);
    before = RunMesh(std::move(meshes[0]), stop_at).view.revision;
    EXPECT_GE(before, stop_at);
  }
  {
    const auto journal = Open();
    const Outcome resumed = RunMesh(std::move(journal->TakeMeshes().at(0)));
    ExpectSame(resumed, whole);
  }
  const auto journal = Open();
  auto meshes = journal->TakeMeshes();
  ASSERT_TRUE(meshes.at(0).record->result) << "no replay is needed";
  const Outcome kept = RunMesh(std::move(meshes[0]), 0, false);
  EXPECT_EQ(kept.view.report->certificate.verdict, whole.view.report->certificate.verdict);
  EXPECT_EQ(kept.view.progress.vertices, whole.view.progress.vertices);
  ExpectSame(kept, whole);
}

// Every revision that it ever had, bit for bit, without a question or a mesher: another version of
// that may ask what it likes.
TEST_F(JournalTest, AFinishedMeshIsServedFromTheDisk) {
  SessionView before;
  std::vector<std::string> wholes;
  const auto all_of = [](const MeshHistory& history) {
    std::vector<std::string> revisions;
    for (std::uint64_t revision = 1; revision <= history.revision(); ++revision) {
      MeshHistory::Cursor cursor = history.BeginAt(revision, 0);
      std::string& bytes = revisions.emplace_back();
      for (DeltaPart part; !part.complete;) {
        part = history.Next(&cursor, 1 << 12);
        bytes.append(reinterpret_cast<const char*>(part.points.data()),
                     part.points.size() * sizeof(double));
        bytes.append(reinterpret_cast<const char*>(part.added.data()),
                     part.added.size() * sizeof(std::uint32_t));
        EXPECT_EQ(part.orientation.has_value(),
                  revision == history.revision() && !part.added.empty());
        if (part.orientation)
          bytes.append(part.orientation->turned.begin(), part.orientation->turned.end());
      }
    }
    return revisions;
  };
  std::uint64_t bytes = 0;
  std::vector<PastProgress> past;
  {
    const auto journal = Open();
    Session session(RecordedSphere(journal->NewMesh(), 0.1));
    std::thread thread([&] { session.Run(); });
    const auto worker = FakeWorker::Join(&session.pool());
    thread.join();
    before = session.View();
    past = session.history().PastAfter(0);
    wholes = all_of(*session.history().loaded());
    bytes = session.history().loaded()->MemoryBytes();
  }
  const auto journal = Open();
  auto meshes = journal->TakeMeshes();
  const auto budget = std::make_shared<MemoryBudget>(MemoryBudget::Limits{bytes / 2, 0});
  SessionOptions reopened = meshes.at(0);
  meshes[0].ports.memory = MemoryBudget::Open(budget, "");
  Session session(std::move(meshes[0]), [](core::Specification, core::Execution) {
    ADD_FAILURE() << "nobody needs a mesher";
    return core::Refuse(core::StatusCode::kInvalidArgument, "none");
  });
  EXPECT_TRUE(session.Over() && session.HasEnded());
  EXPECT_EQ(session.history().loaded(), nullptr);
  EXPECT_EQ(session.View().revision, before.revision);
  EXPECT_EQ(session.history().PublishedRevision(), before.revision);
  EXPECT_EQ(session.View().report->certificate.euler_characteristic, 2);
  ASSERT_EQ(past.size(), before.revision);
  ASSERT_EQ(session.history().PastAfter(0).size(), past.size());
  for (std::size_t i = 0; i < past.size(); ++i) {
    const PastProgress then = session.history().PastAfter(0)[i];
    EXPECT_EQ(then.revision, i + 1);
    EXPECT_EQ(then.progress.vertices, past[i].progress.vertices);
    EXPECT_EQ(then.progress.bad_size, past[i].progress.bad_size);
    EXPECT_EQ(then.elapsed_seconds, past[i].elapsed_seconds);
  }
  EXPECT_EQ(past.back().progress.vertices, before.progress.vertices);
  EXPECT_EQ(budget->total(), EstimateFinishedBytes(session.request().spec));
  EXPECT_EQ(session.history().Load(), HistoryShelf::Loading::kNoMemory);
  EXPECT_EQ(session.history().loaded(), nullptr);

  budget->MakeRoomBy([&] { return true; });
  const auto larger = std::make_shared<MemoryBudget>(MemoryBudget::Limits{2 * bytes, 0});
  auto again = journal->TakeMeshes();
  EXPECT_TRUE(again.empty());
  reopened.ports.memory = MemoryBudget::Open(larger, "");
  Session readable(std::move(reopened));
  ASSERT_EQ(readable.history().Load(), HistoryShelf::Loading::kDone);
  EXPECT_GE(larger->total(), readable.history().loaded()->MemoryBytes());
  EXPECT_TRUE(all_of(*readable.history().loaded()) == wholes);
  {
    const auto held = readable.history().loaded();
    EXPECT_FALSE(readable.history().Unload(Clock::duration::zero())) << "somebody reads it";
  }
  EXPECT_FALSE(readable.history().Unload(std::chrono::hours(1))) << "somebody has just read it";
  EXPECT_TRUE(readable.history().Unload(Clock::duration::zero()));
  EXPECT_EQ(readable.history().loaded(), nullptr);
  EXPECT_EQ(larger->total(), EstimateFinishedBytes(session.request().spec));
  EXPECT_EQ(readable.history().Load(), HistoryShelf::Loading::kDone) << "and back again";
}

// A clock that was an hour fast, or slow, and was set right while no server ran.
TEST_F(JournalTest, ASteppedClockChangesNothingOfHowLongAMeshTook) {
  for (const std::chrono::hours step : {std::chrono::hours(-1), std::chrono::hours(1)}) {
    double before = 0;
    {
      const auto journal = Open();
      SessionOptions mesh = RecordedSphere(journal->NewMesh());
      if (step.count() > 0) mesh.request.name = "meshes/89abcdef0123456789abcdef01234567";
      before = RunMesh(std::move(mesh), 3).view.elapsed_seconds;
    }
    const auto journal = Open();
    auto meshes = journal->TakeMeshes();
    ASSERT_FALSE(meshes.empty());
    SessionOptions resumed = std::move(meshes.back());
    const double recorded = resumed.record->last.elapsed_seconds;
    EXPECT_GT(recorded, 0);
    EXPECT_LE(recorded, before);
    resumed.record->create_time += step;
    const TimePoint began = Clock::now();
    const double after = RunMesh(std::move(resumed)).view.elapsed_seconds;
    EXPECT_GT(after, recorded);
    EXPECT_LE(after, recorded + std::chrono::duration<double>(Clock::now() - began).count());
  }
}

class EndAloneTest : public JournalTest {
 protected:
  // What a server leaves behind that was killed between a mesh's end and its result.
  void RecordEndAlone(SessionState end) {
    RunMesh(RecordedSphere(Open()->NewMesh()), 2);
    const auto journal = Open();
    auto meshes = journal->TakeMeshes();
    const std::uint64_t rounds = meshes.at(0).record->rounds;
    ASSERT_FALSE(
        meshes[0].ports.journal->WriteEnd({end, std::chrono::system_clock::now(), 1, {}, rounds}));
  }
};

TEST_F(EndAloneTest, AnEndWithoutItsResultIsReplayedAndThenRecorded) {
  const Outcome whole = RunMesh(RecordedSphere(nullptr));
  RecordEndAlone(SessionState::kCancelled);
  for (int server = 0; server < 2; ++server) {
    const auto journal = Open();
    auto meshes = journal->TakeMeshes();
    EXPECT_EQ(meshes.at(0).record->result.has_value(), server == 1);
    const std::uint64_t rounds =
        server == 0 ? meshes[0].record->rounds : meshes[0].record->result->revision;
    const Session before(meshes[0]);
    EXPECT_EQ(before.View().state, SessionState::kCancelled) << "before its replay, too";
    const Outcome outcome = RunMesh(std::move(meshes[0]), 0, false);
    EXPECT_EQ(outcome.view.state, SessionState::kCancelled);
    EXPECT_EQ(outcome.view.revision, rounds);
    ASSERT_LE(outcome.points.size(), whole.points.size());
    EXPECT_TRUE(std::equal(outcome.points.begin(), outcome.points.end(), whole.points.begin()));
  }
}

// Its answers lead to another end than the one recorded: they stay for a server that knows better.
TEST_F(EndAloneTest, AReplayThatFailsTakesNoRecordsPlace) {
  RecordEndAlone(SessionState::kSucceeded);
  for (int server = 0; server < 2; ++server) {
    const auto journal = Open();
    auto meshes = journal->TakeMeshes();
    ASSERT_FALSE(meshes.at(0).record->result) << "of another mesh than the one that ended";
    const Outcome outcome = RunMesh(std::move(meshes[0]), 0, false);
    EXPECT_EQ(outcome.view.state, SessionState::kFailed);
    EXPECT_EQ(outcome.view.failure.reason, FailureReason::kReplayMismatch);
  }
}

// Another version asks otherwise, so that the replay fails on its way. A watcher who comes later
// than that has a revision that is lost: it is told to forget it, not refused.
TEST_F(JournalTest, ARevisionThatAReplayLosesWasSeenNevertheless) {
  {
    const auto journal = Open();
    RunMesh(RecordedSphere(journal->NewMesh()), 4);
  }
  const auto journal = Open();
  auto meshes = journal->TakeMeshes();
  const std::uint64_t rounds = meshes.at(0).record->rounds;
  Session session(std::move(meshes[0]), [](core::Specification spec, core::Execution execution) {
    spec.seeds *= -1;
    return core::Mesher::Create(std::move(spec), execution);
  });
  session.Run();
  EXPECT_EQ(session.View().state, SessionState::kFailed);
  EXPECT_LT(session.history().PublishedRevision(), rounds);
  EXPECT_EQ(session.history().SeenRevision(), rounds);
}

// Cancelled while it waits for its replay, by a server that stops before that: the next one replays
// all that watchers have seen.
TEST_F(JournalTest, AMeshCancelledInItsReplayLosesNothingWhenTheServerStops) {
  {
    const auto journal = Open();
    RunMesh(RecordedSphere(journal->NewMesh()), 4);
  }
  std::uint64_t rounds = 0;
  {
    const auto journal = Open();
    auto meshes = journal->TakeMeshes();
    rounds = meshes.at(0).record->rounds;
    bool over_when_replayed = false;
    Session* replayed = nullptr;
    meshes[0].ports.on_replayed = [&] { over_when_replayed = replayed->Over(); };
    Session session(std::move(meshes[0]));
    replayed = &session;
    session.Cancel();
    EXPECT_EQ(session.View().state, SessionState::kCancelled);
    session.Suspend();
    session.Run();
    EXPECT_EQ(session.View().state, SessionState::kCancelled);
    EXPECT_LT(session.View().revision, rounds);
    EXPECT_FALSE(over_when_replayed) << "the store would wait for the thread that waits for it";
  }
  const auto journal = Open();
  auto meshes = journal->TakeMeshes();
  ASSERT_TRUE(meshes.at(0).record->end);
  const Outcome after = RunMesh(std::move(meshes[0]), 0, false);
  EXPECT_EQ(after.view.state, SessionState::kCancelled);
  EXPECT_EQ(after.view.revision, rounds);
}

// Cancelled at any moment, in the middle of a round too.
TEST_F(JournalTest, ACancelledMeshStaysAsItWas) {
  for (const std::uint64_t revision : {1, 2, 3, 5, 8, 10, 12, 14}) {
    SessionView before;
    {
      const auto journal = Open();
      SessionOptions mesh = RecordedSphere(journal->NewMesh(), 0.1);
      mesh.request.name = core::Message("meshes/", revision);  // those before are kept
      Session session(std::move(mesh));
      std::thread thread([&] { session.Run(); });
      const auto worker = FakeWorker::Join(&session.pool());
      while (session.View().revision < revision && !session.HasEnded()) std::this_thread::yield();
      session.Cancel();
      thread.join();
      before = session.View();
    }
    const auto journal = Open();
    auto meshes = journal->TakeMeshes();
    const Outcome after = RunMesh(std::move(meshes.back()), 0, false);
    EXPECT_EQ(after.view.state, before.state);
    EXPECT_EQ(after.view.revision, before.revision);
    EXPECT_EQ(after.view.progress.vertices, before.progress.vertices);
  }
}

// Writes as told.
struct FailingJournal : testing::BlankJournal {
  std::optional<MeshFailure> WriteRound(const core::QueryBatch& batch, const core::Answers&,
                                        const Standing&) override {
    if (batch.round < 3) return std::nullopt;
    return MeshFailure{FailureReason::kJournalFull, "no room"};
  }
  std::optional<MeshFailure> WriteEnd(const SessionEnd& end) override {
    state = end.state;
    return MeshFailure{FailureReason::kJournalFull, "no room"};
  }
  std::optional<MeshFailure> WriteResult(const SessionResult&, const MeshHistory&) override {
    ADD_FAILURE() << "its end is not recorded";
    return std::nullopt;
  }
  SessionState state{};
};

TEST(SessionJournal, ARoundThatCannotBeRecordedIsNotPublished) {
  const auto journal = std::make_shared<FailingJournal>();
  const Outcome outcome = RunMesh(RecordedSphere(journal));
  EXPECT_EQ(outcome.view.state, SessionState::kFailed);
  EXPECT_EQ(outcome.view.failure.reason, FailureReason::kJournalFull);
  EXPECT_EQ(outcome.view.revision, 2u);
  EXPECT_EQ(journal->state, SessionState::kFailed);
}

}  // namespace
}  // namespace stellate::server
