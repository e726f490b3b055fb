#pragma once

#include <Eigen/Core>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "server/base/clock.h"
#include "server/oracles/pace.h"
#include "server/oracles/worker_stats.h"

namespace stellate::server {

using WorkerId = std::uint64_t;
using LeaseId = std::uint64_t;

// How long a mesh waits for its oracles, before it fails.
struct OracleTimeouts {
  Clock::duration answer_limit = std::chrono::seconds(60);  // for one chunk, without a Busy
  Clock::duration busy_limit = std::chrono::hours(1);       // for one chunk, however often Busy
  Clock::duration worker_wait = std::chrono::seconds(60);   // with queries and no worker
};

// How a round is shared among the workers.
struct DispatchPolicy {
  // Target time of a chunk. A worker whose fixed cost (a start, a licence, a schedule) exceeds a
  // quarter of it gets longer ones.
  Clock::duration chunk_target = std::chrono::milliseconds(250);
  // The rest of a round is shared among the workers, in pieces that take at least this.
  Clock::duration least_share = std::chrono::milliseconds(1);
  std::size_t chunk_bytes = std::size_t{1} << 20;  // of a chunk's queries, and of their answers
  int max_leases = 3;     // of a single query, all timed out, before the round fails
  int max_in_flight = 2;  // chunks of one worker, so that it need not wait between two

  // A chunk is overdue, and hedged by an idle worker, once it has taken this many times its
  // expected time, and at least the floor; `unknown` where no worker's pace is known.
  double hedge_factor = 3;
  Clock::duration hedge_floor = std::chrono::milliseconds(200);
  Clock::duration hedge_unknown = std::chrono::seconds(2);

  // The queries examine the oracle: a block is one chunk, as far as its bytes allow and until a
  // lease runs out; and answers are checked for their shape alone: the examination judges their
  // values.
  bool is_examination = false;

  // Share of a worker's queries that it is asked in addition, from another worker's chunks, to
  // compare the answers; before the round ends, up to eight of each family that it answers. 0:
  // none.
  double check_share = 0.01;
};

struct DispatchOptions : OracleTimeouts, DispatchPolicy {};

// A piece of a round, given to one worker for a limited time.
struct Lease {
  LeaseId id = 0;  // 1, 2, ...; never used twice
  WorkerId worker = 0;
  std::size_t block = 0;
  Eigen::Index first = 0;
  Eigen::Index count = 0;
  int timeouts = 0;       // earlier leases of this single query that ran out
  TimePoint sent;         // when it was given
  TimePoint started;      // when the worker could start on it: chunks of one worker queue up
  TimePoint heard;        // when its worker last sent Busy for it
  bool cut = false;       // smaller than a full chunk: the round ended, or is shared
  bool check = false;     // a cross-check of another worker's queries
  LeaseId twin = 0;       // the other lease of a hedged piece: the first answer counts
  bool answered = false;  // the twin was first: this answer is only compared
};

// Distributes the queries of a round among workers. It cuts blocks into chunks by each worker's
// measured pace, leases them, takes back leases that run out, hedges overdue chunks, and has a
// sample of queries answered twice. A plain state machine: no threads, no clock of its own, no
// network. Times passed in must not decrease.
//
//   dispatch.Join(worker, 0);
//   dispatch.Begin(blocks, now);
//   while (!dispatch.Done(now)) {
//     for (const Lease& lease : dispatch.Assign(now)) ...;      // send it to lease.worker
//     if (dispatch.Accept(worker, id, now, &lease) == kCounts)  // an answer came
//       dispatch.MarkAnswered(lease.id, lease.count);           // once it is stored
//     dispatch.Expire(now);                                     // at NextDeadline(), or sooner
//   }
//
// Towards the end of a round the rest is shared among the workers in smaller chunks.
class Dispatch {
 public:
  // Queries of one kind about one face, which may be answered wrongly independently of others.
  using Family = std::pair<int, std::uint64_t>;
  struct Block {
    Eigen::Index queries = 0;
    std::size_t bytes_per_query = 0;  // the larger of query and answer
    Family family = {};
    // Queries [first, second) that are answered already; ascending and disjoint.
    std::vector<std::pair<Eigen::Index, Eigen::Index>> answered = {};
  };
  enum class Failure { kNone, kNoWorker, kAnswerTimeout };

  explicit Dispatch(DispatchOptions options)
      : options_(options), keeps_blocks_whole_(options.is_examination) {}

  void Begin(const std::vector<Block>& blocks, TimePoint now);
  void End();  // forgets the round; answers to its leases are late from now on
  // Whether every query has an answer, and each worker has had one answer of each family compared
  // with another worker's. Does not wait for further cross-checks, or for the slower of two hedged
  // leases.
  bool Done(TimePoint now) const;
  Eigen::Index unanswered() const { return unanswered_; }

  // `max_chunk`: the most queries in one chunk; 0: no limit.
  void Join(WorkerId worker, std::uint32_t max_chunk);
  void Leave(WorkerId worker, TimePoint now);
  std::size_t workers() const { return workers_.size(); }
  // All workers, the earliest first, without their display names.
  std::vector<WorkerStats> ListWorkers() const;

  // Returns new leases, to be sent to their workers.
  std::vector<Lease> Assign(TimePoint now);

  enum class AcceptResult {
    kCounts,
    kForComparison,  // another worker's answer counts; compare this one with it
    kLate,           // the lease has ended; ignore the answer, which is no error
    kUnknown,        // never given to this worker, or answered twice
  };
  // Takes note of an answer and ends its lease, which it returns in `lease`. After kCounts, call
  // MarkAnswered once the answer is stored.
  AcceptResult Accept(WorkerId worker, LeaseId id, TimePoint now, Lease* lease);
  // Takes note that the answers to the `count` queries of an accepted lease are stored. REQUIRES:
  // Accept returned kCounts.
  void MarkAnswered(LeaseId id, Eigen::Index count);
  // Takes note that answers of `a` and `b` to a query of that block have been compared.
  void Compared(WorkerId a, WorkerId b, std::size_t block);
  // Renews the lease of a worker that is still computing. Ignored if the worker does not have it.
  void Busy(WorkerId worker, LeaseId id, TimePoint now);

  // Takes back the leases that have run out.
  void Expire(TimePoint now);
  Failure failure(TimePoint now) const;
  // When to call Expire, failure and Assign next; TimePoint::max(): not before another event.
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
    Pace pace{Pace::Aim{}};
    double check_credit = 0;       // queries that it may be asked in addition
    std::set<Family> compared;     // families in which an answer was compared
    bool stalled = false;          // let a lease run out and has not answered since
    std::set<LeaseId> unanswered;  // chunks sent and not answered, late ones too
    std::uint64_t answered_queries = 0, answered_chunks = 0, newest_chunk = 0;  // for WorkerStats
    std::deque<Lease> leases;  // oldest first; only the first one's time runs

    // Whether it still computes a chunk that is no longer needed, or has stopped answering.
    bool Lagging() const { return stalled || unanswered.size() > leases.size(); }
    bool Idle() const { return leases.empty() && !Lagging(); }
    int InFlight() const;
    bool Wants(Eigen::Index count) const { return max_chunk == 0 || count <= max_chunk; }
  };

  // A comparison that the round still needs: ask another worker a few queries of a lease that
  // `worker` has or had, since no answer of `worker` in that family has been compared yet.
  struct Comparison {
    WorkerId worker = 0;
    std::size_t block = 0;
    Eigen::Index first = 0, count = 0;
    bool answered = false;  // `worker` has answered it, and that answer counts
    LeaseId check = 0;      // the lease of `checker`; 0: not asked yet
    WorkerId checker = 0;
    bool has_answer = false;  // the checker has answered; the comparison is under way
  };

  bool IsCompared(WorkerId worker, const Family& family) const;
  void RequireComparison(const Lease& lease);
  void DropComparisons(WorkerId worker);
  bool IsCheckingFamily(WorkerId worker, const Family& family) const;
  std::optional<WorkerId> PickChecker(const Comparison& comparison) const;
  Eigen::Index MostAtATime(const Worker& worker, std::size_t block, Eigen::Index count) const;
  Lease AskToCompare(Comparison* comparison, WorkerId checker, TimePoint now);
  // How long to wait for a comparison; nothing: do not wait.
  std::optional<TimePoint> ComparisonDeadline(const Comparison& comparison) const;
  Eigen::Index ShareOfTheRest(const Worker& worker) const;
  void Cut(const Worker& worker, Piece* piece, Lease* lease) const;
  bool MayHaveAnother(const Worker& worker) const;
  Worker* PickWorker(WorkerId* id);
  void TakeBack(Worker* worker, bool timed_out);
  Lease* Find(LeaseId id);
  Lease Give(WorkerId id, Lease lease, TimePoint now);
  std::optional<Lease> NextCheck(WorkerId id, Worker* worker) const;
  void Hedge(TimePoint now, std::vector<Lease>* leases);
  TimePoint EndOf(const Lease& lease) const;
  TimePoint OverdueAt(const Worker& worker, std::size_t position) const;
  // The most queries that an idle worker would accept; 0: none is idle.
  Eigen::Index IdleCapacity() const;

  DispatchOptions options_;
  bool active_ = false;
  bool timed_out_ = false;
  bool keeps_blocks_whole_;
  std::vector<Block> blocks_;
  std::deque<Piece> pending_;
  Eigen::Index pending_queries_ = 0;
  Eigen::Index unanswered_ = 0;
  std::map<WorkerId, Worker> workers_;
  std::vector<Comparison> comparisons_;  // at most one for each worker and family
  LeaseId first_of_round_ = 1;
  LeaseId next_lease_ = 1;
  TimePoint without_worker_since_;  // last moment with a worker, or the start of the round
  // The newest lease of the round, and the newest of any other worker: cross-checks come from
  // these.
  std::optional<Lease> newest_, newest_other_;
};

}  // namespace stellate::server
