// What holds wherever meshes are recorded.

#include "server/journal/journal.h"
#include "tests/server/support/journal_fixture.h"

namespace stellate::server {
namespace {

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
  const auto journal = Open();
  const auto replay = journal->TakeMeshes().at(0).ports.journal->BeginRound(batch);
  ASSERT_TRUE(replay.answers);
  EXPECT_EQ(DigestOf(*replay.answers), DigestOf(answers));
}

TEST_F(JournalTest, AnOwnerHasHisShareAndDeletionGivesItBack) {
  const auto opened = Open(0, 100'000);
  ASSERT_TRUE(opened);
  const auto mesh = opened->NewMesh(), others = opened->NewMesh();
  ASSERT_FALSE(mesh->WriteStart(RecordedSphere(mesh).request, {}));
  std::uint64_t round = 1;
  std::optional<MeshFailure> failure;
  while (!failure) failure = WriteOneRound(mesh.get(), round++, 100);
  EXPECT_EQ(failure->reason, FailureReason::kJournalFull);
  EXPECT_GT(round, 10u);
  constexpr std::uint64_t kMesh = 50'000;
  const auto refused = opened->RefuseNewMesh("somebody", kMesh);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->code, core::StatusCode::kLimitExceeded);
  EXPECT_EQ(refused->limit->setting, "owner-journal-bytes");
  EXPECT_EQ(refused->limit->scope, "owner");
  EXPECT_FALSE(opened->RefuseNewMesh("somebody else", kMesh));
  EXPECT_FALSE(mesh->WriteEnd({SessionState::kFailed, {}, 0, *failure, round}));
  SessionOptions options = RecordedSphere(others);
  options.request.name = "meshes/89abcdef0123456789abcdef01234567";
  options.request.owner = "somebody else";
  EXPECT_FALSE(others->WriteStart(options.request, {}));
  EXPECT_FALSE(WriteOneRound(others.get(), 1, 100));
  mesh->Forget();
  while (opened->OwnerBytes("somebody") > 0) std::this_thread::yield();
  EXPECT_FALSE(opened->RefuseNewMesh("somebody", kMesh));
  EXPECT_GT(opened->OwnerBytes("somebody else"), 0u);
}

TEST_F(JournalTest, AFullFileFailsTheRoundAloneAndDeletionMakesRoom) {
  const auto journal = Open(1 << 20);
  const auto small = journal->NewMesh(), large = journal->NewMesh();
  ASSERT_FALSE(small->WriteStart(RecordedSphere(small).request, {}));
  SessionOptions options = RecordedSphere(large);
  options.request.name = "meshes/89abcdef0123456789abcdef01234567";
  ASSERT_FALSE(large->WriteStart(options.request, {}));
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

TEST_F(JournalTest, DeletionIsNotUndoneByALateWrite) {
  {
    const auto journal = Open();
    const auto mesh = WriteRounds(journal.get(), 1, 100'000), early = journal->NewMesh();
    mesh->Forget();
    EXPECT_FALSE(mesh->WriteEnd({SessionState::kCancelled, {}, 0, {}}));
    early->Forget();
    EXPECT_FALSE(early->WriteStart(RecordedSphere(early).request, {}));
  }
  const auto journal = Open();
  EXPECT_TRUE(journal->TakeMeshes().empty());
  EXPECT_EQ(journal->OwnerBytes("somebody"), 0u);
}

}  // namespace
}  // namespace stellate::server
