#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/batch.h"
#include "core/specification.h"
#include "server/dispatch.h"

namespace stellate::server {

// Why a mesh failed: a stable name, as in errors.proto without its prefix, and words for people.
struct MeshFailure {
  std::string reason;
  std::string message;
};

// One round on its way: the questions, and the answers as they come in. Chunks write to disjoint
// columns, so no lock is needed; it lives until the last chunk lets go of it.
struct Round {
  core::QueryBatch batch;
  core::Answers answers;  // of full size from the start
};

// A chunk for a worker: queries [first, first + count) of a block.
struct Chunk {
  LeaseId lease = 0;
  std::shared_ptr<Round> round;
  std::size_t block_index = 0;
  Eigen::Index first = 0;
  Eigen::Index count = 0;

  const core::QueryBlock& block() const { return round->batch.blocks[block_index]; }
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
};

// The workers of one mesh. The session's thread asks a whole round and waits; workers' streams
// join, answer and leave from their own threads. No call but Ask waits for anything.
class OraclePool {
 public:
  // `max_workers` at once.
  OraclePool(const core::Specification& spec, DispatchOptions options, std::size_t max_workers);

  // kFailedPrecondition: the mesh is over. kLimitExceeded: too many workers.
  core::Expected<WorkerId> Join(std::shared_ptr<OracleWorker> worker, std::uint32_t max_chunk);
  void Leave(WorkerId worker);

  // An answer to `lease` came. The chunk that it answers; nothing if the lease has ended, which is
  // no fault of the worker's; kInvalidArgument if it never was this worker's.
  core::Expected<std::optional<Chunk>> Claim(WorkerId worker, LeaseId lease);
  // Checks the answers to a claimed chunk and takes them over. On error nothing is taken, and the
  // caller should call Fail.
  core::Status Deliver(const Chunk& chunk, const core::AnswerBlock& answer);
  // Ends the round, and with it the mesh. The first failure counts.
  void Fail(MeshFailure failure);

  struct Outcome {
    std::shared_ptr<Round> round;        // set when every query was answered
    std::optional<MeshFailure> failure;  // set when the round failed; neither: interrupted
  };
  // Session's thread only. Every wait in it ends: with answers, or by a limit of the options.
  Outcome Ask(const core::QueryBatch& batch);
  // Makes Ask return, now and ever after.
  void Interrupt();

  // No worker may join any more.
  void Shut();
  // Shut, and those here are told.
  void Close(const WorkerEnd& end);

  std::size_t workers() const { return worker_count_; }

 private:
  struct Delivery {
    std::shared_ptr<OracleWorker> worker;
    Chunk chunk;
  };

  std::vector<Delivery> AssignLocked(TimePoint now);
  std::shared_ptr<Round> MakeRound(const core::QueryBatch& batch) const;
  std::vector<Dispatch::Block> Measure(const core::QueryBatch& batch) const;
  MeshFailure Describe(Dispatch::Failure failure) const;
  static void Send(std::vector<Delivery> deliveries);

  const core::Specification spec_;
  const DispatchOptions options_;
  const std::size_t max_workers_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  Dispatch dispatch_;
  std::unordered_map<WorkerId, std::shared_ptr<OracleWorker>> members_;
  std::atomic<std::size_t> worker_count_{0};
  WorkerId next_worker_ = 1;
  std::shared_ptr<Round> round_;
  std::optional<MeshFailure> failure_;
  bool interrupted_ = false;
  bool closed_ = false;
};

}  // namespace stellate::server
