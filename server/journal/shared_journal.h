#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/journal/fair_mutex.h"
#include "server/oracles/oracle_pool.h"
#include "server/storage/data_directory.h"
#include "server/storage/records.h"

namespace stellate::server {

// A server's records, shared by many threads, and two threads of its own: one writes the answers of
// incomplete rounds; the other removes records and compacts the file, in pieces, so that others can
// write in between. Neither workers nor callers of DeleteMesh wait for the disk.
class SharedJournal {
 public:
  // Called by the two threads, which have locked the records.
  class Mesh {
   public:
    virtual ~Mesh() = default;
    virtual bool HasAnswers() const = 0;
    // In a transaction. False: the disk failed.
    virtual bool WriteAnswers(Records* records) = 0;
    // Whether what WriteAnswers wrote is on the disk.
    virtual void AnswersWritten(bool written) = 0;
    // Removes one piece; sets `done` once nothing is left.
    virtual bool RemoveSome(Records* records, bool* done) = 0;
  };

  // `directory`: of records in a file, kept locked until that is closed; null: they are elsewhere.
  SharedJournal(std::unique_ptr<DataDirectory> directory, std::unique_ptr<Records> records)
      : directory_(std::move(directory)), records_(std::move(records)) {}

  // Runs `action` with the records locked. Returns why the server cannot record `what` if it
  // returned false.
  std::optional<MeshFailure> Do(const char* what, FairMutex::Place place,
                                const std::function<bool(Records*)>& action);

  // No thread waits any longer for records that are away: its call fails. Any thread.
  void StopWaiting() { records_->StopWaiting(); }
  // Records::EpochOf. Any thread.
  std::int64_t EpochOf(std::int64_t mesh) const { return records_->EpochOf(mesh); }
  Sharing* sharing() const { return records_->sharing(); }
  // What keeps the records does not answer. Any thread.
  bool AreAway() const { return records_->AreAway(); }
  void StartThreads();
  // Tries once more whatever is due.
  void StopThreads();
  void WriteAnswersLater(std::shared_ptr<Mesh> mesh);
  void RemoveLater(std::shared_ptr<Mesh> mesh);

  // Bytes of all records of an owner's meshes.
  std::uint64_t OwnerBytes(const std::string& owner) const;
  std::uint64_t TotalBytes() const;  // of all owners
  void CountFor(const std::string& owner, std::int64_t bytes);
  // Those of other servers' meshes, which count as well.
  void CountElsewhere(std::map<std::string, std::uint64_t> owners_bytes);

 private:
  MeshFailure WhyNot(const char* what);
  void NoteLongLog();
  void Write(const std::stop_token& stop);
  void Keep(const std::stop_token& stop);
  void Checkpoint();
  bool RemoveSome(Mesh* mesh, bool* done);
  bool GiveBackSome(bool* done);

  const std::unique_ptr<DataDirectory> directory_;
  FairMutex mutex_;
  const std::unique_ptr<Records> records_;

  mutable std::mutex due_mutex_;  // of all that follows; never locked during a wait for the disk
  std::condition_variable_any answers_due_, work_due_;
  std::vector<std::shared_ptr<Mesh>> writing_;  // have answers
  std::deque<std::shared_ptr<Mesh>> removing_;
  bool log_is_long_ = false;
  bool space_is_due_ = false;  // of what was removed

  mutable std::mutex counts_mutex_;  // of these; the last to be locked
  std::map<std::string, std::uint64_t> owner_bytes_, elsewhere_bytes_;
  std::uint64_t total_bytes_ = 0;

  std::jthread writer_, keeper_;
};

}  // namespace stellate::server
