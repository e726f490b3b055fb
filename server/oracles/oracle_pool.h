#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/batch.h"
#include "core/specification.h"
#include "server/base/failure.h"
#include "server/base/refusal.h"
#include "server/oracles/cross_check.h"
#include "server/oracles/dispatch.h"
#include "server/oracles/wall_signs.h"

namespace stellate::server {

// One round on its way: the questions, and the answers as they come in. Chunks write to disjoint
// columns, so no lock is needed; it lives until the last chunk lets go of it.
struct Round {
  std::shared_ptr<const core::QueryBatch> batch;
  core::Answers answers;  // of full size from the start
  // Of each query of each block, whose answer it has; 0: nobody's yet. The pool's lock guards it.
  std::vector<std::vector<WorkerId>> answered_by;
};

// Answers to some queries of a round: `first` and those after it.
struct PartOfRound {
  std::size_t block_index = 0;
  Eigen::Index first = 0;
  core::AnswerBlock answers;
};

// Of the shape that a batch asks for, with nothing in it: what is put into it are its answers.
core::Answers EmptyAnswers(int dimension, const core::QueryBatch& batch, int walls = 0);
// `first` and those after it must be there; what is more than was asked for is left out.
void PutAnswers(const PartOfRound& part, core::Answers* answers);

// A chunk for a worker: queries [first, first + count) of a block.
struct Chunk {
  LeaseId lease = 0;
  std::shared_ptr<Round> round;
  std::size_t block_index = 0;
  Eigen::Index first = 0;
  Eigen::Index count = 0;
  WorkerId worker = 0;  // of a claimed chunk: who answers
  bool second = false;  // of a claimed chunk: another's answer counts, this one is compared with it

  const core::QueryBlock& block() const { return round->batch->blocks[block_index]; }
};

// What becomes of a worker's stream when its mesh is over.
struct WorkerEnd {
  core::Status blame;  // not Ok: the oracle's answers were refused, by a check that names no worker
};

// A worker, as the pool sees it. Both calls come from any thread, with no lock of the pool held;
// they must not block. After End nothing follows.
class OracleWorker {
 public:
  virtual ~OracleWorker() = default;
  virtual void Ask(Chunk chunk) = 0;
  virtual void End(const WorkerEnd& end) = 0;
  // For messages to people; asked once, as it joins. Empty: it has no name.
  virtual std::string Title() const { return ""; }
};

// Told what a pool does, for the metrics. From any thread; must not block.
class PoolObserver {
 public:
  virtual ~PoolObserver() = default;
  virtual void OnBackUps(std::size_t chunks) = 0;    // given to an idle worker as well
  virtual void OnCompared(std::size_t queries) = 0;  // answered by two workers
  virtual void OnDisagreement() = 0;
};

// The workers of one mesh. The session's thread asks a whole round and waits; workers' streams
// join, answer and leave from their own threads. No call but Ask waits for anything.
class OraclePool {
 public:
  // `max_workers` at once.
  OraclePool(const core::Specification& spec, DispatchOptions options, std::size_t max_workers,
             std::shared_ptr<PoolObserver> observer = nullptr);

  // kFailedPrecondition: the mesh is over. kLimitExceeded: too many workers.
  Allowed<WorkerId> Join(std::shared_ptr<OracleWorker> worker, std::uint32_t max_chunk);
  void Leave(WorkerId worker);

  // An answer to `lease` came. The chunk that it answers; nothing if the lease has ended, which is
  // no fault of the worker's; kInvalidArgument if it never was this worker's.
  core::Expected<std::optional<Chunk>> Claim(WorkerId worker, LeaseId lease);
  // The worker is still at a lease's chunk.
  void Busy(WorkerId worker, LeaseId lease);
  // Checks the answers to a claimed chunk and takes them over, or compares them with another
  // worker's, who may come later. On error nothing is taken, and the caller should call Fail. Two
  // workers that disagree fail the mesh, which is no error of this one.
  Refused Deliver(const Chunk& chunk, const core::AnswerBlock& answer);
  // Ends the round, and with it the mesh. The first failure counts.
  void Fail(MeshFailure failure);

  struct Outcome {
    std::shared_ptr<Round> round;        // set when every query was answered
    std::optional<MeshFailure> failure;  // set when the round failed; neither: interrupted
  };
  // Session's thread only. Does `meanwhile` once the workers have the questions, or there are none.
  // Every wait in it ends: with answers, or by a limit of the options. What is `known` is asked of
  // nobody: answers to this very batch, ascending by block and query, no query twice.
  Outcome Ask(
      std::shared_ptr<const core::QueryBatch> batch, const std::function<void()>& meanwhile = [] {},
      const std::vector<PartOfRound>& known = {});
  // Told of queries [first, first + count) of a block as their answers are taken over: they change
  // no more while the round lives. From any thread; must not block.
  using OnAnswered = std::function<void(const std::shared_ptr<const Round>& round,
                                        std::size_t block, Eigen::Index first, Eigen::Index count)>;
  // Before the first Ask.
  void TellOfAnswers(OnAnswered on_answered) { on_answered_ = std::move(on_answered); }
  // Makes Ask return, now and ever after.
  void Interrupt();

  // No worker may join any more.
  void Shut();
  // Shut, and those here are told.
  void Close(const WorkerEnd& end);

  std::size_t workers() const { return worker_count_; }
  // Who they are, the earliest first.
  std::vector<CrewMember> Crew() const;
  // Queries of the round that have no answer yet.
  std::size_t waiting() const;

 private:
  // An answer for comparing, kept while the round lasts.
  struct SecondAnswer {
    Chunk chunk;
    core::AnswerBlock answer;
  };
  struct Delivery {
    std::shared_ptr<OracleWorker> worker;
    Chunk chunk;
  };

  std::vector<Delivery> AssignLocked(TimePoint now);
  std::shared_ptr<Round> MakeRound(std::shared_ptr<const core::QueryBatch> batch) const;
  std::vector<Dispatch::Block> Measure(const core::QueryBatch& batch,
                                       const std::vector<PartOfRound>& known) const;
  MeshFailure Describe(Dispatch::Failure failure) const;
  void TakeOver(const Chunk& chunk, const core::AnswerBlock& answer);
  void Compare(const SecondAnswer& second, Eigen::Index first, Eigen::Index count);
  // Fails the mesh if its words are not empty.
  void TellDisagreement(const Chunk& chunk, const std::string& words);
  std::string TitleLocked(WorkerId worker) const;
  static void Send(std::vector<Delivery> deliveries);

  const core::Specification spec_;
  const DispatchOptions options_;
  const std::size_t max_workers_;
  const std::shared_ptr<PoolObserver> observer_;  // may be null
  OnAnswered on_answered_;                        // may be empty

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  Dispatch dispatch_;
  std::unordered_map<WorkerId, std::shared_ptr<OracleWorker>> members_;
  std::atomic<std::size_t> worker_count_{0};
  WorkerId next_worker_ = 1;
  std::shared_ptr<Round> round_;
  std::vector<std::shared_ptr<const SecondAnswer>> seconds_;  // of the round
  WallSigns signs_;
  std::unordered_map<WorkerId, std::string> titles_;  // of those here or who answered in the round
  std::optional<MeshFailure> failure_;
  bool interrupted_ = false;
  bool closed_ = false;
};

}  // namespace stellate::server
