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
  auto records = OpenDatabase({url, options.max_bytes}, [] { return false; });
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
  // As another server that has seen no beats of this one for a lease, and takes up its meshes.
  void TakeAway() const {
    Ask(url(), "UPDATE stellate.meshes SET server = -1, epoch = epoch + 1 RETURNING id");
  }
  void DeclareGone() const { Ask(url(), "DELETE FROM stellate.servers RETURNING id"); }
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
    const auto mesh = WriteRounds(journal.get(), kRounds, 2000);
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
  // It could perhaps not take leave, and must be missed first.
  while (meshes.empty()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    meshes = journal->Tend();
  }
  ASSERT_EQ(meshes.size(), 1u);
  EXPECT_EQ(meshes[0].record->rounds, kRounds);
  for (std::uint64_t round = 1; round <= kRounds; ++round) {
    EXPECT_TRUE(meshes[0].ports.journal->BeginRound(BatchOf(round, 2000)).answers) << round;
  }
}

TEST_F(PostgresTest, AMeshThatAnotherServerHasIsNotWritten) {
  const auto journal = Open();
  const auto mesh = WriteRounds(journal.get(), 3);
  EXPECT_FALSE(mesh->IsElsewhere());
  TakeAway();
  EXPECT_TRUE(WriteOneRound(mesh.get(), 4));
  EXPECT_TRUE(mesh->IsElsewhere());
  EXPECT_TRUE(WriteOneRound(mesh.get(), 4)) << "nor later";
  EXPECT_EQ(journal->OwnerBytes("somebody"), 0u) << "its bytes count there";
  const auto count = [this] {
    return Ask(url(), "SELECT count(*) FROM stellate.records WHERE kind = 3").Number(0, 0);
  };
  EXPECT_EQ(count(), 3);
  // No server has the number -1: the mesh is anybody's, this one's too, as another.
  auto meshes = journal->Tend();
  ASSERT_EQ(meshes.size(), 1u);
  EXPECT_EQ(meshes[0].record->rounds, 3u);
  EXPECT_FALSE(WriteOneRound(meshes[0].ports.journal.get(), 4));
  EXPECT_TRUE(WriteOneRound(mesh.get(), 5)) << "the old one's epoch is over";
  mesh->Forget();  // nor does it remove any
  EXPECT_EQ(count(), 4);
}

// Away for too long, but nobody has taken its mesh: it goes on, with no replay.
TEST_F(PostgresTest, AServerThatComesBackKeepsWhatNobodyTook) {
  const auto journal = Open();
  const auto kept = WriteRounds(journal.get(), 2);
  Sharing* const sharing = journal->sharing();
  const std::int64_t number = sharing->number();
  DeclareGone();
  while (!sharing->IsTendingDue()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_TRUE(journal->Tend().empty());
  EXPECT_NE(sharing->number(), number);
  EXPECT_FALSE(kept->IsElsewhere());
  EXPECT_FALSE(WriteOneRound(kept.get(), 3));
  TakeAway();
  DeclareGone();
  while (!sharing->IsTendingDue()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_EQ(journal->Tend().size(), 1u) << "taken up anew";
  EXPECT_TRUE(kept->IsElsewhere());
}

TEST_F(PostgresTest, ServersThatAreGoneLeaveTheirMeshesToOthers) {
  auto first = Open();
  const auto second = Open();
  auto mesh = WriteRounds(first.get(), 2);
  EXPECT_TRUE(second->Tend().empty()) << "the first one has it";
  const auto name = RecordedSphere(nullptr).request.name;
  auto found = second->Locate(name);
  ASSERT_TRUE(found && found->exists);
  EXPECT_EQ(found->server, first->sharing()->number());
  EXPECT_FALSE(found->is_gone);
  mesh.reset();
  first.reset();
  found = second->Locate(name);
  EXPECT_TRUE(found && found->exists && found->is_gone);
  EXPECT_EQ(second->Tend(name).size(), 1u);
  found = second->Locate(name);
  EXPECT_EQ(found->server, second->sharing()->number());
  EXPECT_FALSE(second->Locate("meshes/none")->exists);
}

// Its row is there, and does not change.
TEST_F(PostgresTest, ASilentServerIsGoneAfterALease) {
  const auto journal = Open();
  const Rows silent = Ask(url(),
                          "INSERT INTO stellate.servers (address, beats) VALUES ('', 7) "
                          "RETURNING id");
  const std::string here = Message("SELECT FROM stellate.servers WHERE id = ", silent.Number(0, 0));
  const TimePoint began = Clock::now();
  while (Ask(url(), here).count() == 1) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_GE(Clock::now() - began, std::chrono::seconds(5));
  while (journal->sharing()->Peers().size() > 1) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(journal->sharing()->Peers().size(), 1u) << "the other one beats";
}

TEST_F(PostgresTest, AnOwnersMeshesAreCountedOnAllServers) {
  const auto first = Open(), second = Open();
  for (const auto* journal : {&first, &second}) (*journal)->sharing()->LimitOwners(2);
  std::vector<std::shared_ptr<SessionJournal>> begun;
  const auto begin = [&](Journal* journal, const char* name) {
    MeshRequest request = RecordedSphere(nullptr).request;
    request.name = name;
    begun.push_back(journal->NewMesh());
    return begun.back()->WriteStart(request, {});
  };
  EXPECT_FALSE(begin(first.get(), "meshes/1"));
  EXPECT_FALSE(begin(second.get(), "meshes/2"));
  const auto refused = begin(first.get(), "meshes/3");
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->reason, FailureReason::kLimitExceeded);
  EXPECT_TRUE(begun.back()->IsBeyondLimit());
  EXPECT_FALSE(begun[1]->WriteEnd({}));
  EXPECT_FALSE(begin(first.get(), "meshes/3")) << "one has ended";
  second->sharing()->LimitOwners(0);
  EXPECT_TRUE(begin(second.get(), "meshes/3")) << "the name is taken";
  EXPECT_TRUE(begun.back()->IsElsewhere());
}

TEST_F(PostgresTest, RecordsOfAnotherVersionAreLeftAlone) {
  { WriteRounds(Open().get(), 1); }
  Ask(url(), "UPDATE stellate.common SET format = 1 RETURNING format");
  const auto refused = OpenDatabase({url(), 0}, [] { return false; });
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("version 1 "), std::string::npos);
  Ask(url(), "DELETE FROM stellate.records RETURNING mesh");
  EXPECT_TRUE(OpenDatabase({url(), 0}, [] { return false; })) << "there are none any more";
}

TEST_F(PostgresTest, ADamagedRecordIsNamed) {
  { WriteRounds(Open().get(), 2); }
  Ask(url(),
      "UPDATE stellate.records SET bytes = bytes || '\\x00' WHERE kind = 3 AND number = 2 "
      "RETURNING mesh");
  const auto refused = OpenDatabase({url(), 0}, [] { return false; });
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("of kind 3 and number 2"), std::string::npos)
      << refused.error().message;
}

TEST_F(PostgresTest, TablesOfALaterServerAreLeftAlone) {
  { const auto journal = Open(); }
  Ask(url(), "INSERT INTO stellate.migrations VALUES (1000) RETURNING number");
  const auto refused = OpenDatabase({url(), 0}, [] { return false; });
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
    const auto refused = OpenDatabase({setting, 0}, [] { return true; });
    ASSERT_FALSE(refused) << setting;
    EXPECT_EQ(refused.error().code, core::StatusCode::kInvalidArgument);
    EXPECT_NE(refused.error().message.find(words), std::string::npos) << refused.error().message;
    EXPECT_EQ(refused.error().message.find("secret"), std::string::npos) << "it shows the password";
  }
  const auto away = OpenDatabase({"postgresql:///meshes?host=/nowhere", 0, Clock::duration::zero()},
                                 [] { return true; });
  ASSERT_FALSE(away);
  EXPECT_NE(away.error().message.find("has not answered for"), std::string::npos)
      << away.error().message;
}

}  // namespace
}  // namespace stellate::server
