#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

#include "server/oracles/oracle_pool.h"
#include "tests/server/support/sphere.h"

namespace stellate::server::testing {

// A worker without a network: it answers from a thread of its own, as `answer` says.
class FakeWorker : public OracleWorker {
 public:
  // Returns false to leave the chunk unanswered.
  using Answer = std::function<bool(const Chunk&, core::AnswerBlock*)>;

  static bool AnswerTruly(const Chunk& chunk, core::AnswerBlock* answer) {
    *answer = AnswerSphere(chunk.block(), chunk.first, chunk.count);
    return true;
  }

  // Joins `pool`, which must outlive it. When the last that is returned goes it works no more: the
  // pool may be the last to know it, on its own thread.
  static std::shared_ptr<FakeWorker> Join(OraclePool* pool, Answer answer = AnswerTruly) {
    auto worker = std::shared_ptr<FakeWorker>(new FakeWorker(pool, std::move(answer)));
    const auto id = pool->Join(worker, 0);
    if (!id) return nullptr;
    worker->Start(*id);
    return {worker.get(), [worker](FakeWorker* held) { held->Stop(); }};
  }

  void Ask(Chunk chunk) override {
    const std::lock_guard lock(mutex_);
    queue_.push_back(std::move(chunk));
    changed_.notify_all();
  }

  void End(const WorkerEnd& end) override {
    const std::lock_guard lock(mutex_);
    end_ = end;
    changed_.notify_all();
  }

  // Leaves the pool with whatever it has not answered.
  void Leave() {
    Stop();
    pool_->Leave(id_);
  }

  void WaitForEnd() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return end_.has_value(); });
  }

  WorkerEnd end() {
    const std::lock_guard lock(mutex_);
    return *end_;
  }

  // Until it was asked `n` chunks.
  void WaitForChunks(int n) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return taken_ + static_cast<int>(queue_.size()) >= n; });
  }

  int answered() {
    const std::lock_guard lock(mutex_);
    return answered_;
  }

 private:
  FakeWorker(OraclePool* pool, Answer answer) : pool_(pool), answer_(std::move(answer)) {}

  void Start(WorkerId id) {
    id_ = id;
    thread_ = std::thread([this] { Work(); });
  }

  void Stop() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
      changed_.notify_all();
    }
    if (thread_.joinable()) thread_.join();
  }

  void Work() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [this] { return stopping_ || !queue_.empty(); });
      if (stopping_) return;
      const Chunk chunk = std::move(queue_.front());
      queue_.pop_front();
      ++taken_;
      lock.unlock();
      core::AnswerBlock answer;
      bool delivered = false;
      if (answer_(chunk, &answer)) {
        const auto claimed = pool_->Accept(id_, chunk.lease);
        if (claimed && *claimed) {
          const core::Status status = pool_->Deliver(**claimed, answer);
          if (!status.ok()) {
            pool_->Fail(ToMeshFailure(status));
          }
          delivered = status.ok();
        }
      }
      lock.lock();
      if (delivered) ++answered_;
    }
  }

  OraclePool* const pool_;
  const Answer answer_;
  WorkerId id_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Chunk> queue_;
  std::optional<WorkerEnd> end_;
  bool stopping_ = false;
  int taken_ = 0;
  int answered_ = 0;
  std::thread thread_;
};

}  // namespace stellate::server::testing
