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
#include "server/oracles/pool_follower.h"
#include "server/oracles/wall_signs.h"

namespace stellate::server {

// One round in progress: its queries, and the answers so far. Chunks write to disjoint columns, so
// no lock is needed. It lives until the last chunk releases it.
struct Round {
  std::shared_ptr<const core::QueryBatch> batch;
  core::Answers answers;  // of full size from the start
  // For each query of each block, the worker whose answer counts; 0: none yet. Guarded by the
  // pool's lock.
  std::vector<std::vector<WorkerId>> answered_by;
};

// Answers to consecutive queries of a block, from `first` on.
struct PartOfRound {
  std::size_t block_index = 0;
  Eigen::Index first = 0;
  core::AnswerBlock answers;
};

// Returns answers of the shape that the batch asks for, all zero. Fill them with PutAnswers.
core::Answers EmptyAnswers(int dimension, const core::QueryBatch& batch, int walls = 0);
// Writes a part into `answers`. REQUIRES: its queries exist. Ignores arrays that were not asked
// for.
void PutAnswers(const PartOfRound& part, core::Answers* answers);

// A chunk for a worker: queries [first, first + count) of a block.
struct Chunk {
  LeaseId lease = 0;
  std::shared_ptr<Round> round;
  std::size_t block_index = 0;
  Eigen::Index first = 0;
  Eigen::Index count = 0;
  // Set by OraclePool::Accept: the worker that answers, and whether its answer is only compared
  // with another worker's.
  WorkerId worker = 0;
  bool for_comparison = false;

  const core::QueryBlock& block() const { return round->batch->blocks[block_index]; }
};

// How a worker's stream ends when its mesh is over.
struct WorkerEnd {
  core::Status blame;  // not Ok: a check that names no worker refused the oracle's answers
};

// A worker, as the pool sees it. The pool calls Ask and End from any thread, without holding its
// lock; they must not block. End is the last call.
class OracleWorker {
 public:
  virtual ~OracleWorker() = default;
  virtual void Ask(Chunk chunk) = 0;
  virtual void End(const WorkerEnd& end) = 0;
  // For messages to people; called once, when the worker joins. Empty: it has no name.
  virtual std::string DisplayName() const { return ""; }
  // That it came with; asked for as the name is.
  virtual TraceHeaders Trace() const { return {}; }
};

// Receives what a pool does, for the metrics. Called from any thread; must not block.
class PoolObserver {
 public:
  virtual ~PoolObserver() = default;
  virtual void OnHedged(std::size_t chunks) = 0;     // given to an idle worker as well
  virtual void OnCompared(std::size_t queries) = 0;  // answered by two workers
  virtual void OnDisagreement() = 0;
};

// The workers of one mesh. The session's thread calls Ask with a whole round and waits. Workers'
// streams join, answer and leave from their own threads, and never wait:
//
//   pool.Join(worker, 0);                        // the pool calls worker->Ask(chunk)
//   auto chunk = pool.Accept(id, lease);         // an answer to that lease came
//   if (chunk && *chunk) pool.Deliver(**chunk, answer);
//   pool.Leave(id);
class OraclePool {
 public:
  // `max_workers`: the most that may be joined at a time. `observer` may be null.
  OraclePool(const core::Specification& spec, DispatchOptions options, std::size_t max_workers,
             std::shared_ptr<PoolObserver> observer = nullptr);

  // kFailedPrecondition: the mesh is over. kLimitExceeded: too many workers.
  Allowed<WorkerId> Join(std::shared_ptr<OracleWorker> worker, std::uint32_t max_chunk);
  void Leave(WorkerId worker);

  // Ends a lease that has been answered. Returns its chunk, or nothing if the lease has ended
  // before, which is no error of the worker; kInvalidArgument if it never was this worker's.
  core::Expected<std::optional<Chunk>> Accept(WorkerId worker, LeaseId lease);
  // Renews the lease of a worker that is still computing.
  void Busy(WorkerId worker, LeaseId lease);
  // Checks the answers to an accepted chunk and stores them, or compares them with another
  // worker's, now or when those come. On error nothing is stored, and the caller should call Fail.
  // Two workers that disagree fail the mesh; this call succeeds nevertheless.
  Refused Deliver(const Chunk& chunk, const core::AnswerBlock& answer);
  // Ends the round, and with it the mesh. The first failure counts.
  void Fail(MeshFailure failure);

  struct Outcome {
    std::shared_ptr<Round> round;        // set if every query was answered
    std::optional<MeshFailure> failure;  // set if the round failed; neither: interrupted
  };
  // Has a batch answered, and returns when it is. Session's thread only. Calls `meanwhile` once the
  // workers have their chunks. Every wait ends, with answers or by a limit of the options. `known`:
  // answers to this batch that need no worker, ascending by block and query, no query twice.
  Outcome Ask(
      std::shared_ptr<const core::QueryBatch> batch, const std::function<void()>& meanwhile = [] {},
      const std::vector<PartOfRound>& known = {});
  // Called with queries [first, first + count) of a block when their answers are stored; those do
  // not change while the round lives. Called from any thread; must not block.
  using OnAnswered = std::function<void(const std::shared_ptr<const Round>& round,
                                        std::size_t block, Eigen::Index first, Eigen::Index count)>;
  // Before the first Ask.
  void SetOnAnswered(OnAnswered on_answered) { on_answered_ = std::move(on_answered); }
  // Before the first Join; must outlive the pool.
  void SetFollower(PoolFollower* follower) { follower_ = follower; }
  // Makes Ask return, and all later calls of it.
  void Interrupt();

  // Lets no further worker join.
  void Shut();
  // Shuts the pool and ends its workers.
  void Close(const WorkerEnd& end);

  std::size_t workers() const { return worker_count_; }
  // All workers, the earliest first.
  std::vector<WorkerStats> ListWorkers() const;
  // What to add where the mesher refuses answers that fit each other if one manifold gave them: how
  // many workers gave them. "": one alone.
  std::string WhoAnswered() const;
  // Queries of the round that have no answer yet.
  std::size_t waiting() const;

 private:
  // An answer that is only compared, kept while the round lasts.
  struct ComparedAnswer {
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
  void Store(const Chunk& chunk, const core::AnswerBlock& answer);
  void Compare(const ComparedAnswer& compared, Eigen::Index first, Eigen::Index count);
  // Fails the mesh if `words` is not empty.
  void FailOnDisagreement(const Chunk& chunk, const std::string& words);
  std::string NameLocked(WorkerId worker) const;
  static void Send(std::vector<Delivery> deliveries);

  const core::Specification spec_;
  const DispatchOptions options_;
  const std::size_t max_workers_;
  const std::shared_ptr<PoolObserver> observer_;  // may be null
  OnAnswered on_answered_;                        // may be empty
  PoolFollower* follower_ = nullptr;              // may be null

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  Dispatch dispatch_;
  std::unordered_map<WorkerId, std::shared_ptr<OracleWorker>> members_;
  std::atomic<std::size_t> worker_count_{0};
  WorkerId next_worker_ = 1;
  std::shared_ptr<Round> round_;
  std::vector<std::shared_ptr<const ComparedAnswer>> compared_answers_;  // of the round
  WallSigns signs_;
  // Workers that are joined, or that answered in the round.
  std::unordered_map<WorkerId, std::string> display_names_;
  std::optional<MeshFailure> failure_;
  bool interrupted_ = false;
  bool closed_ = false;
};

}  // namespace stellate::server
