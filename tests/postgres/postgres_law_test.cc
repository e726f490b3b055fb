// The cases of tests/server/journal that hold wherever meshes are recorded are compiled into this
// program too, each with a database of its own in the cluster of $STELLATE_TEST_DATABASE. Here is
// what only a database can do: be away, and change hands.

#include <cstdlib>
#include <future>

#include "core/base/message.h"
#include "server/postgres/connection.h"
#include "server/postgres/database.h"
#include "tests/server/support/journal_fixture.h"

namespace stellate::server {
namespace {

using core::Message;
using testing::AnswersTo;
using testing::BatchOf;
using testing::RecordedSphere;
using testing::WriteOneRound;
using testing::WriteRounds;

// With a name of its own for each of the tests' directories.
std::string UrlOf(const std::string& directory) {
  const std::string any = std::getenv("STELLATE_TEST_DATABASE");
  const std::string name = Message("test_", std::hash<std::string>()(directory));
  const std::size_t at = any.find("/postgres?");
  return Message(any.substr(0, at), "/", name, any.substr(at + std::string("/postgres").size()));
}

// Runs a statement in any database of the cluster; its rows.
Rows Ask(const std::string& url, const std::string& sql) {
  auto connection = Connection::Open(url);
  EXPECT_TRUE(connection) << connection.error().message;
  Rows rows;
  const std::atomic<bool> never{false};
  EXPECT_EQ((*connection)->Run(sql.c_str(), {}, &rows, never), Connection::Outcome::kDone)
      << (*connection)->error();
  return rows;
}

core::Expected<std::unique_ptr<Journal>> OpenInDatabase(const JournalOptions& options) {
  const std::string any = std::getenv("STELLATE_TEST_DATABASE"), url = UrlOf(options.directory);
  const std::string name = Message("test_", std::hash<std::string>()(options.directory));
  const Rows there = Ask(any, Message("SELECT FROM pg_database WHERE datname = '", name, "'"));
  if (there.count() == 0) Ask(any, Message("CREATE DATABASE ", name));
  auto records = OpenDatabase({url, "a test", options.max_bytes}, [] { return false; });
  if (!records) return tl::unexpected(std::move(records.error()));
  return Journal::Over(std::move(*records), {"", options.max_bytes, options.owner_bytes});
}

const bool is_set = [] {
  testing::open_journal = OpenInDatabase;
  return true;
}();

class PostgresTest : public testing::JournalTest {
 protected:
  std::string url() const { return UrlOf(directory_); }
  // As when the database restarts, or a line breaks.
  void BreakConnections() const {
    Ask(std::getenv("STELLATE_TEST_DATABASE"),
        "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name = "
        "'stellated' AND pid <> pg_backend_pid()");
  }
  // As another server that has seen no beats for a lease.
  void TakeAway() const {
    Ask(url(), "UPDATE stellate.cluster SET term = term + 1, held = false RETURNING term");
  }
};

TEST_F(PostgresTest, ConnectionsThatBreakLoseAndDoubleNothing) {
  constexpr std::uint64_t kRounds = 40;
  std::uint64_t bytes = 0;
  {
    const auto journal = Open();
    std::jthread breaking([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        BreakConnections();
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
    });
    WriteRounds(journal.get(), kRounds, 2000);
    breaking.request_stop();
    breaking.join();
    bytes = journal->OwnerBytes("somebody");
  }
  const Rows counted = Ask(url(),
                           "SELECT count(*), sum(octet_length(bytes))::int8, "
                           "count(*) FILTER (WHERE kind = 3) FROM stellate.records");
  EXPECT_EQ(counted.Number(0, 0), std::int64_t{2 * kRounds + 1});
  EXPECT_EQ(counted.Number(0, 1), static_cast<std::int64_t>(bytes)) << "the account";
  const auto journal = Open();
  auto meshes = journal->TakeMeshes();
  ASSERT_EQ(meshes.size(), 1u);
  EXPECT_EQ(meshes[0].record->rounds, kRounds);
  for (std::uint64_t round = 1; round <= kRounds; ++round) {
    EXPECT_TRUE(meshes[0].ports.journal->BeginRound(BatchOf(round, 2000)).answers) << round;
  }
}

// Its write waits: a failure would be shown to clients whose mesh goes on elsewhere.
TEST_F(PostgresTest, AServerThatLostItsLeaseWritesNothingAndTellsNobody) {
  const auto journal = Open();
  const auto mesh = WriteRounds(journal.get(), 3);
  EXPECT_FALSE(journal->IsLost());
  TakeAway();
  auto late = std::async(std::launch::async, [&] { return WriteOneRound(mesh.get(), 4); });
  while (!journal->IsLost()) std::this_thread::yield();
  EXPECT_EQ(late.wait_for(std::chrono::milliseconds(300)), std::future_status::timeout);
  const Rows rounds = Ask(url(), "SELECT max(number) FROM stellate.records WHERE kind = 3");
  EXPECT_EQ(rounds.Number(0, 0), 3);
  {
    const auto next = Open();
    auto meshes = next->TakeMeshes();
    ASSERT_EQ(meshes.size(), 1u);
    EXPECT_FALSE(WriteOneRound(meshes[0].ports.journal.get(), 4));
    mesh->Forget();  // nor does it remove any
    journal->StopWaiting();
    EXPECT_TRUE(late.get());
    EXPECT_EQ(Ask(url(), "SELECT count(*) FROM stellate.records WHERE kind = 3").Number(0, 0), 4);
  }
}

TEST_F(PostgresTest, BeatsAloneFindOutThatTheLeaseIsLost) {
  const auto journal = Open();
  TakeAway();
  while (!journal->IsLost()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
}

// One that stands by takes over when the other leaves, and when that falls silent.
TEST_F(PostgresTest, OneServerAtATimeHasADatabase) {
  auto first = Open();
  WriteRounds(first.get(), 2);
  std::atomic<bool> give_up{false};
  const auto wait = [&](bool whole) {
    return std::async(std::launch::async, [&, whole] {
      return OpenDatabase({url(), "another", 0}, [&, whole] { return !whole && give_up; });
    });
  };
  auto impatient = wait(false), patient = wait(true);
  EXPECT_EQ(patient.wait_for(std::chrono::seconds(7)), std::future_status::timeout)
      << "a lease has passed, and it has beaten";
  give_up = true;
  const auto gave_up = impatient.get();
  ASSERT_FALSE(gave_up);
  EXPECT_EQ(gave_up.error().code, core::StatusCode::kCancelled);
  first.reset();
  auto second = patient.get();
  ASSERT_TRUE(second) << second.error().message;
  EXPECT_EQ((*second)->TakeMeshes().size(), 1u);
}

TEST_F(PostgresTest, RecordsOfAnotherVersionAreLeftAlone) {
  { WriteRounds(Open().get(), 1); }
  Ask(url(), "UPDATE stellate.cluster SET format = 1 RETURNING term");
  const auto refused = OpenDatabase({url(), "", 0}, [] { return false; });
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("version 1 "), std::string::npos);
  Ask(url(), "DELETE FROM stellate.records RETURNING mesh");
  EXPECT_TRUE(OpenDatabase({url(), "", 0}, [] { return false; })) << "there are none any more";
}

TEST_F(PostgresTest, ADamagedRecordIsNamed) {
  { WriteRounds(Open().get(), 2); }
  Ask(url(),
      "UPDATE stellate.records SET bytes = bytes || '\\x00' WHERE kind = 3 AND number = 2 "
      "RETURNING mesh");
  const auto refused = OpenDatabase({url(), "", 0}, [] { return false; });
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("of kind 3 and number 2"), std::string::npos)
      << refused.error().message;
}

TEST_F(PostgresTest, TablesOfALaterServerAreLeftAlone) {
  { const auto journal = Open(); }
  Ask(url(), "INSERT INTO stellate.migrations VALUES (1000) RETURNING number");
  const auto refused = OpenDatabase({url(), "", 0}, [] { return false; });
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("later version"), std::string::npos);
}

TEST(DatabaseUrl, ARefusalSaysWhatToDo) {
  const std::string open = ::testing::TempDir() + "no-url";
  testing::Overwrite(open, "hello\n");
  const std::pair<std::string, const char*> cases[] = {
      {"postgresql://ada:secret@/meshes", "write the URL into a file"},
      {"postgresql://ada@db.example.org/meshes", "sslmode=verify-full"},
      {"postgresql://ada@db.example.org/meshes?sslmode=require", "sslmode=verify-full"},
      {"postgresql://ada@localhost,10.0.0.1/meshes", "sslmode=verify-full"},
      {"postgresql:///meshes?hostaddr=10.0.0.1", "sslmode=verify-full"},
      {"postgresql:///meshes?service=mine", "write its host"},
      {"postgresql:///meshes?nonsense=1", "nonsense"},
      {"/nowhere/at/all", "No such file"},
      {open, "postgresql://USER@HOST/DATABASE"},
  };
  for (const auto& [setting, words] : cases) {
    const auto refused = OpenDatabase({setting, "", 0}, [] { return true; });
    ASSERT_FALSE(refused) << setting;
    EXPECT_EQ(refused.error().code, core::StatusCode::kInvalidArgument);
    EXPECT_NE(refused.error().message.find(words), std::string::npos) << refused.error().message;
    EXPECT_EQ(refused.error().message.find("secret"), std::string::npos) << "it shows the password";
  }
  const auto away = OpenDatabase(
      {"postgresql:///meshes?host=/nowhere", "", 0, Clock::duration::zero()}, [] { return true; });
  ASSERT_FALSE(away);
  EXPECT_NE(away.error().message.find("has not answered for"), std::string::npos)
      << away.error().message;
}

}  // namespace
}  // namespace stellate::server
