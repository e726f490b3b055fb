#pragma once

#include <gtest/gtest.h>
#include <sqlite3.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "server/journal/journal.h"
#include "server/records/journal_format.h"
#include "tests/server/support/fake_worker.h"
#include "tests/server/support/sphere.h"

namespace stellate::server::testing {

inline std::string ContentOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline void Overwrite(const std::string& path, const std::string& content) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << content;
}

// How a test opens its journal. A program that has its journals elsewhere sets it before the first
// test, and the same cases hold there; `directory` tells journals apart.
using JournalOpener =
    std::function<core::Expected<std::unique_ptr<Journal>>(const JournalOptions&)>;
inline JournalOpener open_journal = Journal::Open;

// A data directory of its own for each test.
class JournalTest : public ::testing::Test {
 protected:
  JournalTest() {
    static std::atomic<int> count{0};
    directory_ = ::testing::TempDir() + "stellate-journal-" + std::to_string(getpid()) + "-" +
                 std::to_string(count++);
    std::filesystem::remove_all(directory_);
  }
  ~JournalTest() override { std::filesystem::remove_all(directory_); }

  std::string file() const { return directory_ + "/journal.sqlite"; }
  std::string log() const { return file() + "-wal"; }

  std::unique_ptr<Journal> Open(std::uint64_t max_bytes = 0, std::uint64_t owner_bytes = 0) {
    auto journal = open_journal({directory_, max_bytes, owner_bytes});
    EXPECT_TRUE(journal) << journal.error().message;
    return journal ? std::move(*journal) : nullptr;
  }

  // The message of a refusal, which must have left the file as it was.
  std::string Refusal() {
    const std::string before = ContentOf(file()), log_before = ContentOf(log());
    const auto journal = Journal::Open({directory_, 0});
    EXPECT_FALSE(journal);
    EXPECT_TRUE(ContentOf(file()) == before) << "changed by a server that refused it";
    EXPECT_TRUE(ContentOf(log()) == log_before) << "changed by a server that refused it";
    return journal ? "" : journal.error().message;
  }

  // What a server that is killed now leaves behind, in a directory of its own, which becomes the
  // test's.
  void Kill() {
    const std::string left = directory_ + "-killed";
    std::filesystem::remove_all(left);
    std::filesystem::create_directory(left);
    // The mark may lag behind the others, and not they behind it.
    for (const char* name : {"/journal.mark", "/journal.sqlite", "/journal.sqlite-wal"}) {
      if (std::filesystem::exists(directory_ + name)) {
        std::filesystem::copy_file(directory_ + name, left + name);
      }
    }
    killed_ = directory_;
    directory_ = left;
  }

  void Sql(const std::string& sql) const {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(file().c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
        << sqlite3_errmsg(database);
    sqlite3_close(database);
  }

  std::string directory_, killed_;
};

inline SessionOptions RecordedSphere(std::shared_ptr<SessionJournal> journal,
                                     double epsilon = 0.3) {
  SessionOptions options;
  options.request.name = "meshes/0123456789abcdef0123456789abcdef";
  options.request.owner = "somebody";
  options.request.label = "a sphere";
  options.request.about = "fitted to nothing";
  options.request.scale = Eigen::Vector3d(0.01, 500, 1);
  options.request.spec = SphereSpec(epsilon);
  options.request.spec.seeds = Eigen::Vector3d::UnitX();
  options.request.spec.criteria.advance_step = 0.9;
  options.request.spec.criteria.centre_rule = core::CentreRule::kCommonCentre;
  options.request.spec.criteria.size_rate = 0.4;
  options.request.spec.oracle.local_size = true;
  options.request.spec.limits.max_batch_queries = 5000;
  options.request.timeouts.worker_wait = std::chrono::seconds(77);
  options.ports.journal = std::move(journal);
  return options;
}

inline core::QueryBatch BatchOf(std::uint64_t round, Eigen::Index queries = 4, double x = 1) {
  core::QueryBatch batch;
  batch.round = round;
  batch.blocks.resize(2);
  batch.blocks[0].points = Eigen::MatrixXd::Constant(3, queries, x);
  batch.blocks[0].want.tangents = batch.blocks[0].want.sizes = true;
  batch.blocks[1].points = Eigen::MatrixXd::Zero(3, 0);
  return batch;
}

inline core::Answers AnswersTo(const core::QueryBatch& batch) {
  core::Answers answers = EmptyAnswers(2, batch);
  core::AnswerBlock& block = answers.blocks[0];
  block.points.setRandom();
  block.tangents.setRandom();
  block.sizes.setRandom();
  return answers;
}

// Of a round of that number of queries; `what` the journal said.
inline std::optional<MeshFailure> WriteOneRound(SessionJournal* mesh, std::uint64_t round,
                                                Eigen::Index queries = 4) {
  const core::QueryBatch batch = BatchOf(round, queries);
  mesh->BeginRound(batch);
  return mesh->WriteRound(batch, AnswersTo(batch), {round, 0.5});
}

inline std::shared_ptr<SessionJournal> WriteRounds(Journal* journal, std::uint64_t rounds,
                                                   Eigen::Index queries = 4) {
  const auto mesh = journal->NewMesh();
  EXPECT_FALSE(mesh->WriteStart(RecordedSphere(mesh).request, std::chrono::system_clock::now()));
  for (std::uint64_t round = 1; round <= rounds; ++round) {
    EXPECT_FALSE(WriteOneRound(mesh.get(), round, queries));
  }
  return mesh;
}

struct Outcome {
  SessionView view;
  std::vector<double> points;
  std::vector<std::uint32_t> simplices;
};

inline void Read(const MeshHistory& history, Outcome* outcome) {
  MeshHistory::Cursor cursor = history.Begin(0);
  for (DeltaPart part; !part.complete;) {
    part = history.Next(&cursor, 1 << 20);
    outcome->points.insert(outcome->points.end(), part.points.begin(), part.points.end());
    outcome->simplices.insert(outcome->simplices.end(), part.added.begin(), part.added.end());
  }
}

// Runs a mesh until it ends, or until `stop_at` revisions are out and the server stops.
inline Outcome RunMesh(SessionOptions options, std::uint64_t stop_at = 0, bool with_worker = true) {
  options.policy.execution.threads = 1;  // oneTBB itself is not built for ThreadSanitizer
  Session session(std::move(options));
  if (!session.Over()) {
    std::thread thread([&] { session.Run(); });
    // Silent from then on, so that it does not end before it is stopped.
    const auto answer = [stop_at](const Chunk& chunk, core::AnswerBlock* answers) {
      const bool wanted = stop_at == 0 || chunk.round->batch->round <= stop_at;
      return wanted && FakeWorker::AnswerTruly(chunk, answers);
    };
    const auto worker = with_worker ? FakeWorker::Join(&session.pool(), answer) : nullptr;
    while (stop_at > 0 && session.View().revision < stop_at) std::this_thread::yield();
    if (stop_at > 0) session.Suspend();
    thread.join();
  }
  EXPECT_EQ(session.history().Load(), HistoryShelf::Loading::kDone);
  Outcome outcome{session.View(), {}, {}};
  Read(*session.history().loaded(), &outcome);
  return outcome;
}

inline void ExpectSame(const Outcome& a, const Outcome& b) {
  EXPECT_EQ(a.view.state, b.view.state);
  EXPECT_EQ(a.view.revision, b.view.revision);
  EXPECT_EQ(a.points, b.points);
  EXPECT_EQ(a.simplices, b.simplices);
}

}  // namespace stellate::server::testing
