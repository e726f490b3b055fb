// What is the file's own.

#include "server/journal/journal.h"

#include "core/base/message.h"
#include "server/storage/journal_file.h"
#include "tests/server/support/journal_fixture.h"

namespace stellate::server {
namespace {

namespace fs = std::filesystem;
using testing::AnswersTo;
using testing::BatchOf;
using testing::JournalTest;
using testing::WriteRounds;

// As they come, in any order; what was on the disk when the server was killed is not asked again.
TEST_F(JournalTest, AnswersOfARoundThatIsNotWholeAreKept) {
  const core::QueryBatch batch = BatchOf(2, 1000);
  const core::Answers answers = AnswersTo(batch);
  const auto round = std::make_shared<Round>();
  round->batch = std::make_shared<core::QueryBatch>(batch);
  round->answers = answers;
  const auto journal = Open();
  const auto mesh = WriteRounds(journal.get(), 1);
  mesh->BeginRound(batch);
  mesh->TakeAnswers(round, 0, 900, 50);
  mesh->TakeAnswers(round, 0, 0, 10);
  mesh->TakeAnswers(round, 0, 10, 90);
  const std::uint64_t before = journal->OwnerBytes("somebody");
  Kill();
  std::vector<PartOfRound> parts;
  while (parts.empty()) {  // soon: by another thread
    directory_ = killed_;
    Kill();
    const auto next = Open();
    auto meshes = next->TakeMeshes();
    EXPECT_EQ(meshes.at(0).record->rounds, 1u);
    const auto known = meshes[0].ports.journal->BeginRound(batch);
    EXPECT_FALSE(known.answers || known.failure);
    parts = known.parts;
    if (parts.empty()) continue;
    ASSERT_EQ(parts.size(), 2u) << "neighbours are one";
    for (const PartOfRound& part : parts) {
      EXPECT_EQ(part.answers.points,
                answers.blocks[0].points.middleCols(part.first, part.answers.points.cols()));
    }
    EXPECT_EQ(parts[0].first, 0);
    EXPECT_EQ(parts[0].answers.points.cols(), 100);
    EXPECT_EQ(parts[1].first, 900);
    // The rest of it, and the whole is what it would have been.
    ASSERT_FALSE(meshes[0].ports.journal->WriteRound(batch, answers, {1, 0.5}));
    const auto whole = meshes[0].ports.journal->BeginRound(batch);
    ASSERT_TRUE(whole.answers);
    EXPECT_EQ(DigestOf(*whole.answers), DigestOf(answers));
  }
  // Asked otherwise by another version: not used, and not in the way.
  directory_ = killed_;
  Kill();
  const auto other = Open();
  const auto meshes = other->TakeMeshes();
  core::QueryBatch others = BatchOf(2, 1000, 3.0);
  const auto known = meshes.at(0).ports.journal->BeginRound(others);
  EXPECT_TRUE(known.parts.empty() && !known.failure && !known.answers);
  EXPECT_FALSE(meshes[0].ports.journal->WriteRound(others, answers, {1, 0.5}));
  ASSERT_FALSE(mesh->WriteRound(batch, answers, {1, 0.5}));
  EXPECT_GT(journal->OwnerBytes("somebody"), before);
}

TEST_F(JournalTest, RefusesADirectoryInUse) {
  const auto journal = Open();
  EXPECT_NE(Refusal().find("another server"), std::string::npos);
}

TEST_F(JournalTest, DeletionGivesSpaceBack) {
  {
    const auto journal = Open();
    WriteRounds(journal.get(), 1, 100'000)->Forget();
  }
  EXPECT_LT(fs::file_size(file()), 100'000u);
}

TEST_F(JournalTest, TheLogIsMovedIntoTheFileWhileItIsOpen) {
  const auto journal = Open();
  const auto mesh = WriteRounds(journal.get(), 2, 60'000);
  while (fs::file_size(file()) < 9'000'000) std::this_thread::yield();  // soon: by another thread
}

// A server killed between any two pieces of a removal leaves the mesh whole, or nothing of it to be
// seen; the next one removes the rest, and harms no other mesh.
TEST_F(JournalTest, ARemovalCutOffAnywhereLeavesAllOfAMeshOrNone) {
  constexpr std::uint64_t kRounds = 5;
  {
    const auto journal = Open();
    WriteRounds(journal.get(), 2);
    WriteRounds(journal.get(), kRounds, 60'000);  // 5 MB each: more than is removed at once
    WriteRounds(journal.get(), 2, 2000);
  }
  auto place = DataDirectory::Open(directory_);
  ASSERT_TRUE(place);
  auto removing = (*place)->TakeJournal();
  ASSERT_TRUE(removing);
  constexpr std::int64_t kLarge = 2;
  int pieces = 0;
  // What the next server makes of it.
  const auto resume = [&] {
    const std::string killed = directory_ + "/killed";
    fs::remove_all(killed);
    fs::create_directory(killed);
    for (const char* name : {"/journal.sqlite", "/journal.sqlite-wal", "/journal.mark"}) {
      fs::copy_file(directory_ + name, killed + name);
    }
    {
      const auto journal = Journal::Open({killed, 0});
      ASSERT_TRUE(journal) << journal.error().message << " after " << pieces << " pieces";
      std::vector<std::uint64_t> rounds;
      Eigen::Index small = 4;
      for (const SessionOptions& mesh : (*journal)->TakeMeshes()) {
        rounds.push_back(mesh.record->rounds);
        for (std::uint64_t round = 1; round <= mesh.record->rounds; ++round) {
          const Eigen::Index queries = mesh.record->rounds == kRounds ? 60'000 : small;
          EXPECT_TRUE(mesh.ports.journal->BeginRound(BatchOf(round, queries)).answers);
        }
        small = 2000;
      }
      using Rounds = std::vector<std::uint64_t>;
      EXPECT_EQ(rounds, pieces == 0 ? (Rounds{2, kRounds, 2}) : (Rounds{2, 2}));
    }
    if (pieces > 0) {
      EXPECT_LT(fs::file_size(killed + "/journal.sqlite"), 1'000'000u) << pieces << " pieces";
      auto rest = DataDirectory::Open(killed);
      ASSERT_TRUE(rest);
      EXPECT_EQ((*(*rest)->OpenJournal())->TakeMeshes().size(), 2u);
    }
  };
  bool removed = false, given_back = false;
  while (!given_back) {
    if (pieces <= 3 || pieces % 4 == 0) resume();
    if (!removed) {
      ASSERT_TRUE((*removing)->RemoveSome(kLarge, JournalFile::Kinds::kAll, &removed));
      EXPECT_EQ(removed, pieces == 2) << "two rounds, two more, and the last";
    } else {
      ASSERT_TRUE((*removing)->GiveBackSome(&given_back));
    }
    ++pieces;
  }
  EXPECT_GT(pieces, 5);
  EXPECT_LT(fs::file_size(file()), 1'000'000u);
}

}  // namespace
}  // namespace stellate::server
