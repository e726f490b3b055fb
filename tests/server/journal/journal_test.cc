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
using testing::RecordedSphere;
using testing::WriteOneRound;
using testing::WriteRounds;

TEST_F(JournalTest, GivesBackWhatWasWritten) {
  const auto now =
      std::chrono::time_point_cast<std::chrono::microseconds>(std::chrono::system_clock::now());
  const core::QueryBatch batch = BatchOf(1);
  const core::Answers answers = AnswersTo(batch);
  const SessionEnd end{SessionState::kFailed, now, 1.5, {FailureReason::kNoWorker, "none came"}, 1};
  {
    const auto journal = Open();
    const auto mesh = journal->NewMesh();
    ASSERT_FALSE(mesh->WriteStart(RecordedSphere(mesh).request, now));
    mesh->BeginRound(batch);
    ASSERT_FALSE(mesh->WriteRound(batch, answers, {17, 0.5}));
    ASSERT_FALSE(WriteOneRound(mesh.get(), 2));  // led to nothing: cancelled, say
    ASSERT_FALSE(mesh->WriteEnd(end));
    EXPECT_GT(journal->OwnerBytes("somebody"), 400u);
  }
  const auto journal = Open();
  const auto meshes = journal->TakeMeshes();
  ASSERT_EQ(meshes.size(), 1u);
  const SessionOptions& back = meshes[0];
  EXPECT_EQ(EncodeStart(back.request, back.record->create_time),
            EncodeStart(RecordedSphere(nullptr).request, now));
  EXPECT_EQ(back.request.spec.seeds, RecordedSphere(nullptr).request.spec.seeds);
  EXPECT_EQ(back.record->rounds, 1u);
  EXPECT_EQ(back.record->last.elapsed_seconds, 0.5);
  ASSERT_TRUE(back.record->end);
  EXPECT_EQ(EncodeEnd(*back.record->end), EncodeEnd(end));
  EXPECT_FALSE(back.record->result);
  const auto replay = back.ports.journal->BeginRound(batch);
  ASSERT_TRUE(replay.answers);
  EXPECT_EQ(DigestOf(*replay.answers), DigestOf(answers));
  const auto beyond = back.ports.journal->BeginRound(BatchOf(3));
  EXPECT_FALSE(beyond.answers || beyond.failure);
  const auto other = back.ports.journal->BeginRound(BatchOf(1, 4, 2.0));
  ASSERT_TRUE(other.failure);
  EXPECT_EQ(other.failure->reason, FailureReason::kReplayMismatch);
  EXPECT_GT(journal->OwnerBytes("somebody"), 400u);
  EXPECT_EQ(journal->OwnerBytes("somebody else"), 0u);
}

TEST_F(JournalTest, LargeRoundsAreKeptInParts) {
  const core::QueryBatch batch = BatchOf(1, 500'000);
  const core::Answers answers = AnswersTo(batch);  // 40 MB
  {
    const auto journal = Open();
    const auto mesh = journal->NewMesh();
    ASSERT_FALSE(mesh->WriteStart(RecordedSphere(mesh).request, {}));
    mesh->BeginRound(batch);
    ASSERT_FALSE(mesh->WriteRound(batch, answers, {1, 0.5}));
  }
  const auto replay = Open()->TakeMeshes().at(0).ports.journal->BeginRound(batch);
  ASSERT_TRUE(replay.answers);
  EXPECT_EQ(DigestOf(*replay.answers), DigestOf(answers));
}

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

TEST_F(JournalTest, AnOwnerHasHisShareAndDeletionGivesItBack) {
  auto opened = Journal::Open({directory_, 0, 100'000});
  ASSERT_TRUE(opened);
  const auto mesh = (*opened)->NewMesh(), others = (*opened)->NewMesh();
  ASSERT_FALSE(mesh->WriteStart(RecordedSphere(mesh).request, {}));
  std::uint64_t round = 1;
  std::optional<MeshFailure> failure;
  while (!failure) failure = WriteOneRound(mesh.get(), round++, 100);
  EXPECT_EQ(failure->reason, FailureReason::kJournalFull);
  EXPECT_GT(round, 10u);
  constexpr std::uint64_t kMesh = 50'000;
  const auto refused = (*opened)->RefuseNewMesh("somebody", kMesh);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->code, core::StatusCode::kLimitExceeded);
  EXPECT_EQ(refused->limit->setting, "owner-journal-bytes");
  EXPECT_EQ(refused->limit->scope, "owner");
  EXPECT_FALSE((*opened)->RefuseNewMesh("somebody else", kMesh));
  EXPECT_FALSE(mesh->WriteEnd({SessionState::kFailed, {}, 0, *failure, round}));
  SessionOptions options = RecordedSphere(others);
  options.request.owner = "somebody else";
  EXPECT_FALSE(others->WriteStart(options.request, {}));
  EXPECT_FALSE(WriteOneRound(others.get(), 1, 100));
  mesh->Forget();
  while ((*opened)->OwnerBytes("somebody") > 0) std::this_thread::yield();
  EXPECT_FALSE((*opened)->RefuseNewMesh("somebody", kMesh));
  EXPECT_GT((*opened)->OwnerBytes("somebody else"), 0u);
}

TEST_F(JournalTest, RefusesADirectoryInUse) {
  const auto journal = Open();
  EXPECT_NE(Refusal().find("another server"), std::string::npos);
}

TEST_F(JournalTest, AFullFileFailsTheRoundAloneAndDeletionMakesRoom) {
  const auto journal = Open(1 << 20);
  const auto small = journal->NewMesh(), large = journal->NewMesh();
  ASSERT_FALSE(small->WriteStart(RecordedSphere(small).request, {}));
  ASSERT_FALSE(large->WriteStart(RecordedSphere(large).request, {}));
  ASSERT_FALSE(WriteOneRound(large.get(), 1, 8000));
  EXPECT_FALSE(journal->RefuseNewMesh("", 1000));
  const auto failure = WriteOneRound(large.get(), 2, 8000);
  ASSERT_TRUE(failure);
  EXPECT_EQ(failure->reason, FailureReason::kJournalFull);
  const auto refused = journal->RefuseNewMesh("", 1 << 20);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->limit->setting, "max-journal-bytes");
  EXPECT_FALSE(WriteOneRound(small.get(), 1)) << "others are unharmed";
  large->Forget();
  std::optional<MeshFailure> still;
  do {  // soon: the removal is another thread's
    still = WriteOneRound(small.get(), 2, 8000);
  } while (still);
  EXPECT_FALSE(WriteOneRound(large.get(), 2)) << "nobody wants it any more";
}

TEST_F(JournalTest, DeletionGivesSpaceBackAndIsNotUndoneByALateWrite) {
  {
    const auto journal = Open();
    const auto mesh = WriteRounds(journal.get(), 1, 100'000), early = journal->NewMesh();
    mesh->Forget();
    EXPECT_FALSE(mesh->WriteEnd({SessionState::kCancelled, {}, 0, {}}));
    early->Forget();
    EXPECT_FALSE(early->WriteStart(RecordedSphere(early).request, {}));
  }
  EXPECT_LT(fs::file_size(file()), 100'000u);
  EXPECT_TRUE(Open()->TakeMeshes().empty());
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
