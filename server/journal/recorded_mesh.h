#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/journal/shared_journal.h"
#include "server/records/journal_format.h"
#include "server/session/session_journal.h"
#include "server/storage/records.h"

namespace stellate::server {

// The record of one mesh in a shared journal.
class RecordedMesh final : public SessionJournal,
                           public SharedJournal::Mesh,
                           public std::enable_shared_from_this<RecordedMesh> {
 public:
  // A new mesh. `owner_limit`: the most bytes of the records of one owner's meshes, where clients
  // are authenticated; 0: no limit.
  RecordedMesh(std::shared_ptr<SharedJournal> journal, std::uint64_t owner_limit)
      : journal_(std::move(journal)), owner_limit_(owner_limit) {}
  ~RecordedMesh() override;
  // A recorded mesh.
  RecordedMesh(std::shared_ptr<SharedJournal> journal, std::uint64_t owner_limit, std::int64_t id,
               const StoredMesh& stored, const MeshRequest& request);

  std::optional<MeshFailure> WriteStart(const MeshRequest& request,
                                        std::chrono::system_clock::time_point create_time) override;
  Known BeginRound(const core::QueryBatch& batch) override;
  void TakeAnswers(const std::shared_ptr<const Round>& round, std::size_t block, Eigen::Index first,
                   Eigen::Index count) override;
  std::optional<MeshFailure> WriteRound(const core::QueryBatch& batch, const core::Answers& answers,
                                        const Standing& standing) override;
  std::optional<MeshFailure> WriteEnd(const SessionEnd& end) override;
  std::optional<MeshFailure> WriteResult(const SessionResult& result,
                                         const MeshHistory& history) override;
  core::Expected<std::unique_ptr<MeshHistory>> ReadHistory() override;
  void Forget() override;
  bool IsElsewhere() const override;
  bool IsBeyondLimit() const override { return is_beyond_limit_; }

  bool HasAnswers() const override;
  bool WriteAnswers(Records* records) override;
  void AnswersWritten(bool written) override;
  bool RemoveSome(Records* records, bool* done) override;
  // The result is recorded: removes the rounds that led to it.
  void RemoveRounds();

 private:
  void SetShape(const MeshRequest& request);
  std::optional<MeshFailure> Do(const char* what, FairMutex::Place place, std::uint64_t bytes,
                                const std::function<bool(Records*)>& action);
  std::optional<MeshFailure> RefuseShare(std::uint64_t bytes) const;
  void Recount(const Records& records);
  bool PutAnswers(Records* records, const core::Answers& answers,
                  const std::vector<AnswerRange>& ranges, std::int64_t* next_part) const;
  Known ReadRound(const core::QueryBatch& batch);
  Known ReadPartOfRound(const core::QueryBatch& batch);
  bool ReadAnswers(Records* records, const core::QueryBatch& batch, std::int64_t part,
                   RecordedAnswers* answers, Records::Found* found) const;
  bool Fits(const core::QueryBatch& batch, const PartOfRound& part) const;

  bool IsHeld() const;

  const std::shared_ptr<SharedJournal> journal_;
  const std::uint64_t owner_limit_;
  std::string owner_;
  struct {
    int dimension = 0, ambient_dimension = 0, walls = 0, simplex_dimension = 0, labels = 1;
  } shape_;
  std::atomic<bool> forgotten_{false}, is_beyond_limit_{false};
  std::atomic<std::int64_t> id_{0};     // 0: not recorded
  std::atomic<std::int64_t> epoch_{0};  // Records::EpochOf then

  // Only for the thread that has locked the records.
  std::uint64_t counted_ = 0;  // of its bytes, for its owner
  bool has_history_ = false;   // some of it
  struct Parts {
    std::int64_t next = 0;
    std::vector<AnswerRange> written;
  };
  Parts parts_;  // of the round
  Parts draft_;  // further ones, in force once the transaction is committed

  // For the session's thread alone:
  std::uint64_t rounds_ = 0;  // that are complete
  bool has_answers_ = false;  // of the next round

  mutable std::mutex mutex_;
  std::int64_t round_ = 0;       // under way; 0: none
  std::uint64_t questions_ = 0;  // digest of the round's queries
  std::vector<Eigen::Index> sizes_;
  std::shared_ptr<const Round> answers_;
  std::vector<AnswerRange> pending_;  // answered and not written
};

}  // namespace stellate::server
