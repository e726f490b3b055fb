#pragma once

#include <Eigen/Core>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

namespace stellate::server {

using Clock = std::chrono::steady_clock;
using TimePoint = Clock::time_point;
using WorkerId = std::uint64_t;
using LeaseId = std::uint64_t;

struct DispatchOptions {
  Clock::duration answer_limit = std::chrono::seconds(60);        // for one chunk
  Clock::duration worker_wait = std::chrono::seconds(60);         // with queries and no worker
  Clock::duration chunk_target = std::chrono::milliseconds(250);  // what a chunk should take
  std::size_t chunk_bytes = std::size_t{1} << 20;  // of a chunk's queries, and of their answers
  int max_leases = 3;     // of one chunk, all timed out, before the round fails
  int max_in_flight = 2;  // chunks that one worker holds, so that it need not wait between two
};

// A piece of a round given to one worker for a while.
struct Lease {
  LeaseId id = 0;  // 1, 2, ...; never used twice
  WorkerId worker = 0;
  std::size_t block = 0;
  Eigen::Index first = 0;
  Eigen::Index count = 0;
  int timeouts = 0;   // earlier leases of this piece that ran out
  TimePoint started;  // when the worker could start on it: chunks of one worker queue up
};

// Who answers what: cuts the blocks of a round into chunks, leases these to workers by their
// measured speed, and takes back what a worker leaves undone. A plain state machine: no threads,
// no clock of its own, no network. Times passed in must not go back.
class Dispatch {
 public:
  struct Block {
    Eigen::Index queries = 0;
    std::size_t bytes_per_query = 0;  // the larger of question and answer
  };
  enum class Failure { kNone, kNoWorker, kAnswerTimeout };

  explicit Dispatch(DispatchOptions options) : options_(options) {}

  void Begin(const std::vector<Block>& blocks, TimePoint now);
  void End();  // forgets the round; its leases become late
  bool Active() const { return active_; }
  bool Done() const { return active_ && unsettled_ == 0; }

  // `max_chunk` queries at most in one chunk; 0: no wish.
  void Join(WorkerId worker, std::uint32_t max_chunk);
  void Leave(WorkerId worker, TimePoint now);
  std::size_t workers() const { return workers_.size(); }

  // Hands out what the workers can take now.
  std::vector<Lease> Assign(TimePoint now);

  enum class ClaimResult {
    kClaimed,
    kLate,     // the lease ended before; the answer is of no use and no harm
    kUnknown,  // never given to this worker, or answered more often than asked
  };
  // An answer came. The lease ends; the piece counts as answered once Settle is called.
  ClaimResult Claim(WorkerId worker, LeaseId id, TimePoint now, Lease* lease);
  void Settle(const Lease& lease);

  // Takes back the chunks of workers that are too slow.
  void Expire(TimePoint now);
  Failure failure(TimePoint now) const;
  // When Expire or failure next has something to say; TimePoint::max() if never.
  TimePoint NextDeadline() const;

 private:
  struct Piece {
    std::size_t block = 0;
    Eigen::Index first = 0;
    Eigen::Index count = 0;
    int timeouts = 0;
  };
  struct Worker {
    std::uint32_t max_chunk = 0;
    double speed = 0;              // queries per second, 0: not known yet
    bool stalled = false;          // let a lease run out and has not answered since
    std::uint64_t unanswered = 0;  // chunks sent less answers come, late ones too
    std::deque<Lease> leases;      // oldest first; only the first one's time runs
  };

  Eigen::Index ChunkSize(const Worker& worker, const Piece& piece) const;
  Worker* PickWorker(WorkerId* id);
  void TakeBack(Worker* worker, bool timed_out);

  DispatchOptions options_;
  bool active_ = false;
  bool timed_out_ = false;
  std::vector<Block> blocks_;
  std::deque<Piece> pending_;
  Eigen::Index pending_queries_ = 0;
  Eigen::Index unsettled_ = 0;
  std::map<WorkerId, Worker> workers_;
  LeaseId first_of_round_ = 1;
  LeaseId next_lease_ = 1;
  TimePoint deserted_since_;  // last moment with a worker, or the start of the round
};

}  // namespace stellate::server
