#include "server/journal.h"

#include <gtest/gtest.h>
#include <sqlite3.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include "core/message.h"
#include "server/journal_file.h"
#include "server/journal_format.h"
#include "tests/server/fake_worker.h"
#include "tests/server/sphere.h"

namespace stellate::server {
namespace {

namespace fs = std::filesystem;
using testing::FakeWorker;
using testing::SphereSpec;

// A data directory of its own for each test.
class JournalTest : public ::testing::Test {
 protected:
  JournalTest() {
    static std::atomic<int> count{0};
    directory_ = ::testing::TempDir() + "stellate-journal-" + std::to_string(getpid()) + "-" +
                 std::to_string(count++);
    fs::remove_all(directory_);
  }
  ~JournalTest() override { fs::remove_all(directory_); }

  std::string file() const { return directory_ + "/journal.sqlite"; }

  std::unique_ptr<Journal> Open(std::uint64_t max_bytes = 0) {
    auto journal = Journal::Open({directory_, max_bytes});
    EXPECT_TRUE(journal) << journal.error().message;
    return journal ? std::move(*journal) : nullptr;
  }

  // The message of a refusal, which must have left the file as it was.
  std::string Refusal() {
    const std::string before = Content();
    const auto journal = Journal::Open({directory_, 0});
    EXPECT_FALSE(journal);
    EXPECT_EQ(Content(), before) << "changed by a server that refused it";
    return journal ? "" : journal.error().message;
  }

  std::string Content() const {
    std::ifstream in(file(), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void Overwrite(const std::string& content) const {
    std::ofstream(file(), std::ios::binary | std::ios::trunc) << content;
  }
  void Sql(const std::string& sql) const {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(file().c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
        << sqlite3_errmsg(database);
    sqlite3_close(database);
  }

  std::string directory_;
};

SessionOptions Options(std::shared_ptr<SessionJournal> journal, double epsilon = 0.3) {
  SessionOptions options;
  options.name = "meshes/0123456789abcdef0123456789abcdef";
  options.owner = "somebody";
  options.label = "a sphere";
  options.spec = SphereSpec(epsilon);
  options.spec.threads = 1;  // oneTBB itself is not built for ThreadSanitizer
  options.spec.seeds = Eigen::Vector3d::UnitX();
  options.spec.criteria.advance_step = 0.9;
  options.spec.criteria.judging = core::Judging::kCommonCentre;
  options.spec.criteria.size_rate = 0.4;
  options.spec.oracle.local_size = true;
  options.spec.limits.max_batch_queries = 5000;
  options.dispatch.worker_wait = std::chrono::seconds(77);
  options.journal = std::move(journal);
  return options;
}

core::QueryBatch Batch(std::uint64_t round, double x = 1) {
  core::QueryBatch batch;
  batch.round = round;
  batch.blocks.resize(1);
  batch.blocks[0].points = Eigen::MatrixXd::Constant(3, 4, x);
  return batch;
}

core::Answers AnswersOf(Eigen::Index queries) {
  core::Answers answers;
  answers.blocks.resize(2);
  answers.blocks[0].points = Eigen::MatrixXd::Random(3, queries);
  answers.blocks[0].found.assign(static_cast<std::size_t>(queries), 1);
  answers.blocks[0].tangents = Eigen::MatrixXd::Random(6, queries);
  answers.blocks[0].sizes = Eigen::VectorXd::Random(queries);
  return answers;
}

void WriteRounds(Journal& journal, std::uint64_t rounds, Eigen::Index queries) {
  const auto mesh = journal.NewMesh();
  EXPECT_FALSE(mesh->WriteStart(Options(mesh), std::chrono::system_clock::now()));
  for (std::uint64_t round = 1; round <= rounds; ++round) {
    EXPECT_FALSE(mesh->WriteRound(Batch(round), AnswersOf(queries)));
  }
}

void WriteTwoRounds(Journal& journal, Eigen::Index queries = 4) {
  WriteRounds(journal, 2, queries);
}

TEST_F(JournalTest, GivesBackWhatWasWritten) {
  const auto now =
      std::chrono::time_point_cast<std::chrono::microseconds>(std::chrono::system_clock::now());
  const core::Answers answers = AnswersOf(4);
  const SessionEnd end{SessionState::kFailed, now, 1.5, {"NO_WORKER", "none came"}, 1};
  {
    const auto journal = Open();
    const auto mesh = journal->NewMesh();
    ASSERT_FALSE(mesh->WriteStart(Options(mesh), now));
    ASSERT_FALSE(mesh->WriteRound(Batch(1), answers));
    ASSERT_FALSE(mesh->WriteRound(Batch(2), answers));  // led to nothing: cancelled, say
    ASSERT_FALSE(mesh->WriteEnd(end));
  }
  const auto meshes = Open()->TakeMeshes();
  ASSERT_EQ(meshes.size(), 1u);
  const SessionOptions& back = meshes[0];
  EXPECT_EQ(EncodeStart(back, back.record->create_time), EncodeStart(Options(nullptr), now));
  EXPECT_EQ(back.spec.seeds, Options(nullptr).spec.seeds);
  EXPECT_EQ(back.record->rounds, 1u);
  ASSERT_TRUE(back.record->end);
  EXPECT_EQ(EncodeEnd(*back.record->end), EncodeEnd(end));
  const auto replay = back.journal->ReadRound(Batch(1));
  ASSERT_TRUE(replay.answers);
  EXPECT_EQ(EncodeAnswers(*replay.answers), EncodeAnswers(answers));
  const auto beyond = back.journal->ReadRound(Batch(3));
  EXPECT_FALSE(beyond.answers || beyond.failure);
  const auto other = back.journal->ReadRound(Batch(1, 2.0));
  ASSERT_TRUE(other.failure);
  EXPECT_EQ(other.failure->reason, "REPLAY_MISMATCH");
}

TEST_F(JournalTest, LargeRoundsAreKeptInParts) {
  const core::Answers answers = AnswersOf(500'000);  // 40 MB
  {
    const auto journal = Open();
    const auto mesh = journal->NewMesh();
    ASSERT_FALSE(mesh->WriteStart(Options(mesh), {}));
    ASSERT_FALSE(mesh->WriteRound(Batch(1), answers));
  }
  const auto replay = Open()->TakeMeshes().at(0).journal->ReadRound(Batch(1));
  ASSERT_TRUE(replay.answers);
  EXPECT_EQ(replay.answers->blocks[0].points, answers.blocks[0].points);
  EXPECT_EQ(replay.answers->blocks[0].tangents, answers.blocks[0].tangents);
  EXPECT_EQ(replay.answers->blocks[0].sizes, answers.blocks[0].sizes);
}

TEST_F(JournalTest, RefusesFilesThatAreNoJournals) {
  fs::create_directories(directory_);
  for (const std::string& content :
       {std::string(), std::string("a letter\n"), std::string(4096, 'x')}) {
    Overwrite(content);
    EXPECT_NE(Refusal().find("no journal"), std::string::npos);
  }
  fs::remove(file());
  Sql("CREATE TABLE accounts (name TEXT)");
  EXPECT_NE(Refusal().find("no journal"), std::string::npos) << "another program's database";
}

TEST_F(JournalTest, RefusesOtherVersionsAndOtherTables) {
  WriteTwoRounds(*Open());
  Sql("PRAGMA user_version=99");
  EXPECT_NE(Refusal().find("version 99"), std::string::npos);
  Sql(core::Message("PRAGMA user_version=", kJournalVersion, "; CREATE TABLE more (x)"));
  EXPECT_NE(Refusal().find("damaged"), std::string::npos);
}

TEST_F(JournalTest, RefusesLostOrChangedRecords) {
  for (const char* sql :
       {"DELETE FROM rounds WHERE round = 1", "UPDATE rounds SET round = 3 WHERE round = 2",
        "UPDATE rounds SET questions = 5 WHERE round = 2",
        "UPDATE rounds SET answers = (SELECT answers FROM rounds WHERE round = 1)",
        "UPDATE meshes SET start = zeroblob(100)", "UPDATE meshes SET finish = x'00'",
        "DELETE FROM meshes"}) {
    fs::remove_all(directory_);
    WriteTwoRounds(*Open());
    Sql(sql);
    EXPECT_NE(Refusal().find("damaged"), std::string::npos) << sql;
  }
}

TEST_F(JournalTest, RefusesAnyBlockOverwrittenOrCutOff) {
  WriteTwoRounds(*Open(), 2000);
  const std::string good = Content();
  ASSERT_GT(good.size(), 100'000u);
  for (std::size_t at = 0; at < good.size(); at += 4096) {
    // The middle of a page that is in use; unused bytes mean nothing to anybody.
    std::string bad = good;
    bad.replace(at, 4096, 4096, '\xff');
    Overwrite(bad);
    EXPECT_NE(Refusal(), "") << "page " << at / 4096;
  }
  Overwrite(good.substr(0, good.size() / 2));
  EXPECT_NE(Refusal(), "");
  Overwrite(good);
  EXPECT_NE(Open(), nullptr);
}

TEST_F(JournalTest, RefusesADirectoryInUse) {
  const auto journal = Open();
  EXPECT_NE(Refusal().find("another server"), std::string::npos);
}

TEST_F(JournalTest, AFullFileFailsTheRoundAloneAndDeletionMakesRoom) {
  const auto journal = Open(1 << 20);
  const auto small = journal->NewMesh(), large = journal->NewMesh();
  ASSERT_FALSE(small->WriteStart(Options(small), {}));
  ASSERT_FALSE(large->WriteStart(Options(large), {}));
  ASSERT_FALSE(large->WriteRound(Batch(1), AnswersOf(8000)));
  const auto failure = large->WriteRound(Batch(2), AnswersOf(8000));
  ASSERT_TRUE(failure);
  EXPECT_EQ(failure->reason, "JOURNAL_FULL");
  EXPECT_FALSE(small->WriteRound(Batch(1), AnswersOf(4))) << "others are unharmed";
  large->Forget();
  std::optional<MeshFailure> still;
  do {  // soon: the removal is another thread's
    still = small->WriteRound(Batch(2), AnswersOf(8000));
  } while (still);
  EXPECT_FALSE(large->WriteRound(Batch(2), AnswersOf(4))) << "nobody wants it any more";
}

TEST_F(JournalTest, DeletionGivesSpaceBackAndIsNotUndoneByALateWrite) {
  {
    const auto journal = Open();
    const auto mesh = journal->NewMesh(), early = journal->NewMesh();
    ASSERT_FALSE(mesh->WriteStart(Options(mesh), {}));
    ASSERT_FALSE(mesh->WriteRound(Batch(1), AnswersOf(100'000)));
    mesh->Forget();
    EXPECT_FALSE(mesh->WriteEnd({SessionState::kCancelled, {}, 0, {}}));
    early->Forget();
    EXPECT_FALSE(early->WriteStart(Options(early), {}));
  }
  EXPECT_LT(fs::file_size(file()), 100'000u);
  EXPECT_TRUE(Open()->TakeMeshes().empty());
}

TEST_F(JournalTest, TheLogIsMovedIntoTheFileWhileItIsOpen) {
  const auto journal = Open();
  WriteTwoRounds(*journal, 60'000);
  while (fs::file_size(file()) < 9'000'000) std::this_thread::yield();  // soon: by another thread
}

// A server killed between any two pieces of a removal leaves the mesh whole, or nothing of it to be
// seen; the next one removes the rest, and harms no other mesh.
TEST_F(JournalTest, ARemovalCutOffAnywhereLeavesAllOfAMeshOrNone) {
  constexpr std::uint64_t kRounds = 5;
  {
    const auto journal = Open();
    WriteTwoRounds(*journal);
    WriteRounds(*journal, kRounds, 60'000);  // 5 MB each: more than is removed at once
    WriteTwoRounds(*journal, 2000);
  }
  auto removing = JournalFile::Open(directory_, 0);
  ASSERT_TRUE(removing);
  const std::int64_t large = (*removing)->TakeMeshes().at(1).id;
  int pieces = 0;
  // What the next server makes of it.
  const auto resume = [&] {
    const std::string killed = directory_ + "/killed";
    fs::remove_all(killed);
    fs::create_directory(killed);
    for (const char* name : {"/journal.sqlite", "/journal.sqlite-wal"}) {
      fs::copy_file(directory_ + name, killed + name);
    }
    {
      const auto journal = Journal::Open({killed, 0});
      ASSERT_TRUE(journal) << journal.error().message << " after " << pieces << " pieces";
      std::vector<std::uint64_t> rounds;
      for (const SessionOptions& mesh : (*journal)->TakeMeshes()) {
        rounds.push_back(mesh.record->rounds);
        for (std::uint64_t round = 1; round <= mesh.record->rounds; ++round) {
          EXPECT_TRUE(mesh.journal->ReadRound(Batch(round)).answers);
        }
      }
      using Rounds = std::vector<std::uint64_t>;
      EXPECT_EQ(rounds, pieces == 0 ? (Rounds{2, kRounds, 2}) : (Rounds{2, 2}));
    }
    if (pieces > 0) {
      EXPECT_LT(fs::file_size(killed + "/journal.sqlite"), 1'000'000u) << pieces << " pieces";
      auto rest = JournalFile::Open(killed, 0);
      ASSERT_TRUE(rest);
      EXPECT_EQ((*rest)->TakeMeshes().size(), 2u);
    }
  };
  bool removed = false, given_back = false;
  while (!given_back) {
    if (pieces <= 3 || pieces % 4 == 0) resume();
    if (!removed) {
      ASSERT_TRUE((*removing)->RemoveSome(large, EncodeEnd(RemovedEnd()), &removed));
      EXPECT_EQ(removed, pieces == 2) << "two rounds, two more, and the last";
    } else {
      ASSERT_TRUE((*removing)->GiveBackSome(&given_back));
    }
    ++pieces;
  }
  EXPECT_GT(pieces, 5);
  EXPECT_LT(fs::file_size(file()), 1'000'000u);
}

struct Outcome {
  SessionView view;
  std::vector<double> points;
  std::vector<std::uint32_t> simplices;
};

// Runs a mesh until it ends, or until `stop_at` revisions are out and the server stops.
Outcome Mesh(SessionOptions options, std::uint64_t stop_at = 0, bool with_worker = true) {
  Session session(std::move(options));
  std::thread thread([&] { session.Run(); });
  const auto worker = with_worker ? FakeWorker::Join(&session.pool()) : nullptr;
  while (stop_at > 0 && session.View().revision < stop_at) std::this_thread::yield();
  if (stop_at > 0) session.Suspend();
  thread.join();
  Outcome outcome{session.View(), {}, {}};
  WatchLog::Cursor cursor = session.history().Begin(0);
  for (DeltaPart part; !part.complete;) {
    part = session.history().Next(&cursor, 1 << 20);
    outcome.points.insert(outcome.points.end(), part.points.begin(), part.points.end());
    outcome.simplices.insert(outcome.simplices.end(), part.added.begin(), part.added.end());
  }
  return outcome;
}

TEST_F(JournalTest, AMeshStoppedAgainAndAgainIsTheUndisturbedOne) {
  const Outcome whole = Mesh(Options(nullptr));
  ASSERT_EQ(whole.view.state, SessionState::kSucceeded);
  ASSERT_GT(whole.view.revision, 6u);
  {
    const auto journal = Open();
    Mesh(Options(journal->NewMesh()), 1);
  }
  std::uint64_t before = 0;
  for (const std::uint64_t stop_at : {3, 5}) {
    const auto journal = Open();
    auto meshes = journal->TakeMeshes();
    ASSERT_EQ(meshes.size(), 1u);
    EXPECT_FALSE(meshes[0].record->end) << "a stop of the server is no end";
    EXPECT_GE(meshes[0].record->rounds, before);
    before = Mesh(std::move(meshes[0]), stop_at).view.revision;
    EXPECT_GE(before, stop_at);
  }
  {
    const auto journal = Open();
    const Outcome resumed = Mesh(std::move(journal->TakeMeshes().at(0)));
    EXPECT_EQ(resumed.view.state, SessionState::kSucceeded);
    EXPECT_EQ(resumed.view.revision, whole.view.revision);
    EXPECT_EQ(resumed.points, whole.points);
    EXPECT_EQ(resumed.simplices, whole.simplices);
  }
  const auto journal = Open();
  const Outcome kept = Mesh(std::move(journal->TakeMeshes().at(0)), 0, false);
  EXPECT_EQ(kept.view.state, SessionState::kSucceeded) << "finished, with no worker";
  EXPECT_EQ(kept.view.report->certificate.verdict, whole.view.report->certificate.verdict);
  EXPECT_EQ(kept.points, whole.points);
  EXPECT_EQ(kept.simplices, whole.simplices);
}

// Cancelled at any moment, in the middle of a round too.
TEST_F(JournalTest, ACancelledMeshStaysAsItWas) {
  for (const std::uint64_t revision : {1, 2, 3, 5, 8, 10, 12, 14}) {
    SessionView before;
    {
      const auto journal = Open();
      Session session(Options(journal->NewMesh(), 0.1));
      std::thread thread([&] { session.Run(); });
      const auto worker = FakeWorker::Join(&session.pool());
      while (session.View().revision < revision && !session.HasEnded()) std::this_thread::yield();
      session.Cancel();
      thread.join();
      before = session.View();
    }
    const auto journal = Open();
    auto meshes = journal->TakeMeshes();
    const Outcome after = Mesh(std::move(meshes.back()), 0, false);
    EXPECT_EQ(after.view.state, before.state);
    EXPECT_EQ(after.view.revision, before.revision);
    EXPECT_EQ(after.view.progress.vertices, before.progress.vertices);
  }
}

// Writes as told.
struct FailingJournal : SessionJournal {
  std::optional<MeshFailure> WriteStart(const SessionOptions&,
                                        std::chrono::system_clock::time_point) override {
    return std::nullopt;
  }
  std::optional<MeshFailure> WriteRound(const core::QueryBatch& batch,
                                        const core::Answers&) override {
    if (batch.round < 3) return std::nullopt;
    return MeshFailure{"JOURNAL_FULL", "no room"};
  }
  std::optional<MeshFailure> WriteEnd(const SessionEnd& end) override {
    state = end.state;
    return MeshFailure{"JOURNAL_FULL", "no room"};
  }
  Replay ReadRound(const core::QueryBatch&) override { return {}; }
  void Forget() override {}
  SessionState state{};
};

TEST(SessionJournal, ARoundThatCannotBeRecordedIsNotPublished) {
  const auto journal = std::make_shared<FailingJournal>();
  const Outcome outcome = Mesh(Options(journal));
  EXPECT_EQ(outcome.view.state, SessionState::kFailed);
  EXPECT_EQ(outcome.view.failure.reason, "JOURNAL_FULL");
  EXPECT_EQ(outcome.view.revision, 2u);
  EXPECT_EQ(journal->state, SessionState::kFailed);
}

}  // namespace
}  // namespace stellate::server
