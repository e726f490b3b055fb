// Journals that are not what they were, and those of another version.

#include "core/base/message.h"
#include "tests/server/support/journal_fixture.h"

namespace stellate::server {
namespace {

namespace fs = std::filesystem;
using testing::ContentOf;
using testing::JournalTest;
using testing::Overwrite;
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
  Sql("PRAGMA user_version=6");
  EXPECT_NE(Refusal().find("run the server that wrote it"), std::string::npos);
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

}  // namespace
}  // namespace stellate::server
