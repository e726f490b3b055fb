// Journals that are not what they were, and those of an earlier version.

#include "core/base/message.h"
#include "server/records/record_bytes.h"
#include "tests/server/support/blank_journal.h"
#include "tests/server/support/journal_fixture.h"

namespace stellate::server {
namespace {

namespace fs = std::filesystem;
using testing::AnswersTo;
using testing::BatchOf;
using testing::ContentOf;
using testing::ExpectSame;
using testing::JournalTest;
using testing::Outcome;
using testing::Overwrite;
using testing::RecordedSphere;
using testing::RunMesh;
using testing::WriteOneRound;
using testing::WriteRounds;

TEST_F(JournalTest, RefusesFilesThatAreNoJournals) {
  fs::create_directories(directory_);
  for (const std::string& content :
       {std::string(), std::string("a letter\n"), std::string(4096, 'x')}) {
    Overwrite(file(), content);
    EXPECT_NE(Refusal().find("no journal"), std::string::npos);
  }
  fs::remove(file());
  Sql("CREATE TABLE accounts (name TEXT)");
  EXPECT_NE(Refusal().find("no journal"), std::string::npos) << "another program's database";
}

TEST_F(JournalTest, RefusesOtherVersionsAndOtherTables) {
  WriteRounds(Open().get(), 2);
  Sql("PRAGMA user_version=99");
  EXPECT_NE(Refusal().find("damaged"), std::string::npos) << "its mark knows better";
  fs::remove(directory_ + "/journal.mark");
  EXPECT_NE(Refusal().find("version 99"), std::string::npos);
  Sql("PRAGMA user_version=4");
  EXPECT_NE(Refusal(), "") << "it is none of version 4";
  Sql(core::Message("PRAGMA user_version=", std::to_string(kJournalVersion),
                    "; CREATE TABLE more (x)"));
  EXPECT_NE(Refusal().find("damaged"), std::string::npos);
}

// What SQLite finds nothing wrong with.
TEST_F(JournalTest, RefusesLostOrChangedRecords) {
  for (const char* sql :
       {"DELETE FROM records WHERE kind = 3 AND number = 1", "DELETE FROM records WHERE number = 2",
        "UPDATE records SET number = 3 WHERE number = 2",
        "UPDATE records SET bytes = (SELECT bytes FROM records WHERE kind = 1) WHERE kind = 3",
        "UPDATE records SET bytes = zeroblob(100) WHERE kind = 1", "DELETE FROM records",
        "UPDATE records SET kind = 9 WHERE kind = 1", "DELETE FROM state",
        "UPDATE state SET bytes = x'00'"}) {
    fs::remove_all(directory_);
    WriteRounds(Open().get(), 2);
    Sql(sql);
    EXPECT_NE(Refusal().find("damaged"), std::string::npos) << sql;
  }
}

TEST_F(JournalTest, RefusesAnyBlockOverwrittenOrCutOff) {
  WriteRounds(Open().get(), 2, 2000);
  const std::string good = ContentOf(file());
  ASSERT_GT(good.size(), 100'000u);
  for (std::size_t at = 0; at < good.size(); at += 4096) {
    // The middle of a page that is in use; unused bytes mean nothing to anybody.
    std::string bad = good;
    bad.replace(at, 4096, 4096, '\xff');
    Overwrite(file(), bad);
    EXPECT_NE(Refusal(), "") << "page " << at / 4096;
  }
  Overwrite(file(), good.substr(0, good.size() / 2));
  EXPECT_NE(Refusal(), "");
  Overwrite(file(), good);
  EXPECT_NE(Open(), nullptr);
}

// SQLite takes a bad frame, and all after it, for what was never written. It is that only where
// nobody was told that it was.
TEST_F(JournalTest, ADamagedLogIsRefusedAndATornOneIsNot) {
  const auto journal = Open();
  const auto mesh = WriteRounds(journal.get(), 5, 100);
  Kill();
  const std::string good = ContentOf(log());
  ASSERT_GT(good.size(), 10 * 4096u);
  for (const double share : {0.0, 0.2, 0.5, 0.9, 0.999}) {
    std::string bad = good;
    bad[static_cast<std::size_t>(share * static_cast<double>(good.size()))] ^= 1;
    Overwrite(log(), bad);
    EXPECT_NE(Refusal().find("damaged"), std::string::npos) << share;
    Overwrite(log(), good.substr(0, static_cast<std::size_t>(share * good.size())));
    EXPECT_NE(Refusal().find("damaged"), std::string::npos) << "cut off at " << share;
  }
  fs::remove(log());
  EXPECT_NE(Refusal().find("transactions are missing"), std::string::npos);
  // A write that was under way when the server was killed.
  Overwrite(log(), good + good.substr(32 + 4120, 3 * 4120 + 1000));
  EXPECT_EQ(Open()->TakeMeshes().at(0).record->rounds, 5u);
}

TEST_F(JournalTest, TheMarkBesideItIsNeededOnlyWithALog) {
  {
    const auto journal = Open();
    WriteRounds(journal.get(), 2);
    Kill();
    fs::remove(directory_ + "/journal.mark");
    EXPECT_NE(Refusal().find("its mark is not"), std::string::npos);
    directory_ = killed_;
  }
  // A copy of the file of a server that had stopped.
  fs::remove(directory_ + "/journal.mark");
  EXPECT_EQ(Open()->TakeMeshes().size(), 1u);
  const std::string older = ContentOf(file());
  WriteRounds(Open().get(), 1);
  Overwrite(file(), older);
  EXPECT_NE(Refusal().find("older copy"), std::string::npos);
  const std::string mark = ContentOf(directory_ + "/journal.mark");
  Overwrite(directory_ + "/journal.mark", std::string(mark.size(), 'x'));
  EXPECT_NE(Refusal().find("journal.mark"), std::string::npos);
}

// As version 4 wrote it: tables of meshes and of rounds, each record with its seal behind it.
class Version4 {
 public:
  explicit Version4(const std::string& path) {
    EXPECT_EQ(sqlite3_open(path.c_str(), &database_), SQLITE_OK);
    Run("PRAGMA auto_vacuum=INCREMENTAL; PRAGMA journal_mode=WAL;"
        "CREATE TABLE meshes (id INTEGER PRIMARY KEY, start BLOB NOT NULL, finish BLOB);"
        "CREATE TABLE rounds (mesh INTEGER NOT NULL REFERENCES meshes ON DELETE CASCADE, "
        "round INTEGER NOT NULL, part INTEGER NOT NULL, parts INTEGER NOT NULL, "
        "questions INTEGER NOT NULL, answers BLOB NOT NULL, PRIMARY KEY (mesh, round, part));"
        "PRAGMA application_id=1400130676; PRAGMA user_version=4");
  }
  ~Version4() { sqlite3_close(database_); }

  void Mesh(int id, const MeshRequest& request) {
    Run("INSERT INTO meshes (id, start) VALUES (" + std::to_string(id) + ", " +
        Sealed(StartOf(request), core::Message("start/", id)) + ")");
  }
  void End(int id, const SessionEnd& end) {
    Run("UPDATE meshes SET finish = " + Sealed(EncodeEnd(end), core::Message("end/", id)) +
        " WHERE id = " + std::to_string(id));
  }
  // In two parts.
  void Round(int id, const core::QueryBatch& batch, const core::Answers& answers) {
    RecordWriter writer;
    writer.Number(answers.blocks.size());
    for (const core::AnswerBlock& block : answers.blocks) {
      writer.Numbers(block.points);
      writer.Bytes(block.found);
      writer.Numbers(block.tangents);
      writer.Numbers(block.sizes);
    }
    const std::string whole = writer.Take();
    const std::uint64_t questions = DigestOf(batch);
    const std::size_t half = whole.size() / 2;
    for (int part = 0; part < 2; ++part) {
      const std::string bytes = part == 0 ? whole.substr(0, half) : whole.substr(half);
      const std::string place = core::Message("round/", id, "/", static_cast<int>(batch.round), "/",
                                              part, "/2/", questions);
      Run(core::Message("INSERT INTO rounds VALUES (", id, ", ", batch.round, ", ", part, ", 2, ",
                        static_cast<std::int64_t>(questions), ", ", Sealed(bytes, place), ")"));
    }
  }

 private:
  // Without what was added since: two numbers, a number that is not there, and another.
  static std::string StartOf(MeshRequest request) {
    const auto now = std::chrono::system_clock::now();
    const std::string start = EncodeStart(request, now);
    request.spec.components = 1;
    const std::string other = EncodeStart(request, now);
    const auto added = std::mismatch(start.begin(), start.end(), other.begin()).first;
    return std::string(start.begin(), added) + std::string(added + 4 * kWord, start.end());
  }
  static std::string Sealed(std::string record, const std::string& place) {
    RecordDigest digest;
    digest.Add(place.data(), place.size());
    digest.Add(record.data(), record.size());
    const std::uint64_t seal = digest.value();
    record.append(reinterpret_cast<const char*>(&seal), sizeof(seal));
    std::string literal = "x'";
    for (const char byte : record) {
      constexpr char kHex[] = "0123456789abcdef";
      literal += kHex[static_cast<unsigned char>(byte) >> 4];
      literal += kHex[static_cast<unsigned char>(byte) & 15];
    }
    return literal + "'";
  }
  void Run(const std::string& sql) {
    EXPECT_EQ(sqlite3_exec(database_, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
        << sqlite3_errmsg(database_);
  }
  sqlite3* database_ = nullptr;
};

// Takes down what a mesh asks and is answered.
struct Recorder : testing::BlankJournal {
  explicit Recorder(Version4* version4) : old(version4) {}
  std::optional<MeshFailure> WriteStart(const MeshRequest& request,
                                        std::chrono::system_clock::time_point) override {
    old->Mesh(1, request);
    return std::nullopt;
  }
  std::optional<MeshFailure> WriteRound(const core::QueryBatch& batch, const core::Answers& answers,
                                        std::uint64_t) override {
    old->Round(1, batch, answers);
    return std::nullopt;
  }
  std::optional<MeshFailure> WriteEnd(const SessionEnd& end) override {
    old->End(1, end);
    return std::nullopt;
  }

  Version4* const old;
};

TEST_F(JournalTest, TakesOverAJournalOfVersion4) {
  fs::create_directories(directory_);
  Outcome whole;
  {
    Version4 old(file());
    whole = RunMesh(RecordedSphere(std::make_shared<Recorder>(&old)));
    MeshRequest request = RecordedSphere(nullptr).request;
    request.name = "meshes/00000000000000000000000000000002";
    old.Mesh(2, request);
    const core::QueryBatch batch = BatchOf(1);
    old.Round(2, batch, AnswersTo(batch));
    old.Mesh(3, request);
    old.End(3, {SessionState::kCancelled, {}, 0, {FailureReason::kRemoved, ""}, 0});
    old.Round(3, batch, AnswersTo(batch));
  }
  const std::string before = ContentOf(file());
  {
    const auto journal = Open();
    auto meshes = journal->TakeMeshes();
    ASSERT_EQ(meshes.size(), 2u) << "the third was being removed";
    EXPECT_FALSE(meshes[0].record->result);
    ASSERT_TRUE(meshes[0].record->end);
    EXPECT_EQ(meshes[1].request.name, "meshes/00000000000000000000000000000002");
    EXPECT_EQ(meshes[1].record->rounds, 1u);
    EXPECT_TRUE(meshes[1].ports.journal->BeginRound(BatchOf(1)).answers);
    ExpectSame(RunMesh(std::move(meshes[0]), 0, false), whole);
  }
  EXPECT_TRUE(ContentOf(directory_ + "/journal-version-4.sqlite") == before) << "to go back to";
  const auto journal = Open();
  auto meshes = journal->TakeMeshes();
  ASSERT_TRUE(meshes.at(0).record->result) << "replayed once and for all";
  ExpectSame(RunMesh(std::move(meshes[0]), 0, false), whole);
}

TEST_F(JournalTest, ADamagedJournalOfVersion4IsNotTakenOver) {
  fs::create_directories(directory_);
  {
    Version4 old(file());
    old.Mesh(1, RecordedSphere(nullptr).request);
    const core::QueryBatch first = BatchOf(1), third = BatchOf(3);
    old.Round(1, first, AnswersTo(first));
    old.Round(1, third, AnswersTo(third));
  }
  EXPECT_NE(Refusal().find("gap"), std::string::npos);
  Sql("DELETE FROM rounds WHERE round = 3; UPDATE rounds SET questions = 5 WHERE part = 1");
  EXPECT_NE(Refusal().find("damaged"), std::string::npos);
}

}  // namespace
}  // namespace stellate::server
