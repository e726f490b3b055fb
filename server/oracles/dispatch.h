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
#include "server/oracles/crew.h"
#include "server/oracles/pace.h"

namespace stellate::server {

using WorkerId = std::uint64_t;
using LeaseId = std::uint64_t;

// How long a mesh waits for its oracles, before it fails.
struct OracleTimeouts {
  Clock::duration answer_limit = std::chrono::seconds(60);  // for one chunk, without a word
  Clock::duration busy_limit = std::chrono::hours(1);       // for one chunk, with words
  Clock::duration worker_wait = std::chrono::seconds(60);   // with queries and no worker
};

// How a round is shared among the workers.
struct DispatchPolicy {
  // What a chunk should take, unless its worker's fixed cost (a start, a licence, a schedule) would
  // be more than a quarter of it.
  Clock::duration chunk_target = std::chrono::milliseconds(250);
  // What is left of a round is shared among the crew, but not in pieces that take less.
  Clock::duration least_share = std::chrono::milliseconds(1);
  std::size_t chunk_bytes = std::size_t{1} << 20;  // of a chunk's queries, and of their answers
  int max_leases = 3;     // of one query alone, all timed out, before the round fails
  int max_in_flight = 2;  // chunks that one worker holds, so that it need not wait between two

  // A chunk is a straggler once it has taken this many times what its worker's pace promises, and
  // no less than the floor: an idle worker gets it as well. Without a pace to go by: so long.
  double straggler_factor = 3;
  Clock::duration straggler_floor = std::chrono::milliseconds(200);
  Clock::duration straggler_unknown = std::chrono::seconds(2);

  // Share of its queries that a worker is asked on top, from another's chunks, so that the answers
  // can be compared; and one of each family that it answers, before the round ends. 0: none.
  double check_share = 0.01;
};

struct DispatchOptions : OracleTimeouts, DispatchPolicy {};

// A piece of a round given to one worker for a while.
struct Lease {
  LeaseId id = 0;  // 1, 2, ...; never used twice
  WorkerId worker = 0;
  std::size_t block = 0;
  Eigen::Index first = 0;
  Eigen::Index count = 0;
  int timeouts = 0;       // earlier leases of this query alone that ran out
  TimePoint started;      // when the worker could start on it: chunks of one worker queue up
  TimePoint heard;        // when its worker last said that it is working on it
  bool cut = false;       // smaller than its worker might have had: the round ended, or is shared
  bool queued = false;    // given while its worker had others
  bool check = false;     // another has these queries: the answers are for comparing
  LeaseId twin = 0;       // of the same piece, given to another too: the first answer counts
  bool answered = false;  // the twin was first: this answer is for comparing
};

// Who answers what: cuts the blocks of a round into chunks, leases these to workers by their
// measured pace, takes back what a worker leaves undone, gives stragglers to idle workers as
// well, and has a sample of queries answered twice. A plain state machine: no threads, no clock of
// its own, no network. Times passed in must not go back.
//
// A chunk is what fits the worker's pace. Towards a round's end what is left is shared among the
// crew.
class Dispatch {
 public:
  // What may go wrong by itself: queries of a kind, about a face. Any number will do.
  using Family = std::pair<int, std::uint64_t>;
  struct Block {
    Eigen::Index queries = 0;
    std::size_t bytes_per_query = 0;  // the larger of question and answer
    Family family = {};
    // Queries [first, second) that have their answers from the start; ascending and disjoint.
    std::vector<std::pair<Eigen::Index, Eigen::Index>> answered = {};
  };
  enum class Failure { kNone, kNoWorker, kAnswerTimeout };

  explicit Dispatch(DispatchOptions options) : options_(options) {}

  void Begin(const std::vector<Block>& blocks, TimePoint now);
  void End();  // forgets the round; its leases become late
  bool Active() const { return active_; }
  // Every query has an answer, and of each worker one of each family has been compared with
  // another's. Further checks and beaten stragglers are not waited for.
  bool Done(TimePoint now) const;
  Eigen::Index unanswered() const { return unsettled_; }

  // `max_chunk` queries at most in one chunk; 0: no wish.
  void Join(WorkerId worker, std::uint32_t max_chunk);
  void Leave(WorkerId worker, TimePoint now);
  std::size_t workers() const { return workers_.size(); }
  // All workers, without their titles; the earliest first.
  std::vector<CrewMember> Crew() const;

  // Hands out what the workers can take now.
  std::vector<Lease> Assign(TimePoint now);

  enum class ClaimResult {
    kClaimed,
    kSecond,   // for comparing: another worker's answer counts
    kLate,     // the lease ended before; the answer is ignored, and no fault
    kUnknown,  // never given to this worker, or answered more often than asked
  };
  // An answer came. The lease ends; the piece counts as answered once Settle is called.
  ClaimResult Claim(WorkerId worker, LeaseId id, TimePoint now, Lease* lease);
  void Settle(const Lease& lease);  // kClaimed only
  // Answers of the two to a query of that block have been compared.
  void Compared(WorkerId a, WorkerId b, std::size_t block);
  // The worker is still computing. A lease that it does not have is ignored.
  void Busy(WorkerId worker, LeaseId id, TimePoint now);

  // Takes back the chunks of workers that are too slow.
  void Expire(TimePoint now);
  Failure failure(TimePoint now) const;
  // When Expire, failure or Assign next has something to say; TimePoint::max() if never.
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
    double check_credit = 0;       // queries that it may be asked on top
    std::set<Family> compared;     // of which an answer was compared with another worker's
    bool stalled = false;          // let a lease run out and has not answered since
    std::set<LeaseId> unanswered;  // chunks sent whose answers have not come, late ones too
    std::uint64_t answered_queries = 0, answered_chunks = 0, newest_chunk = 0;  // for Crew
    std::deque<Lease> leases;  // oldest first; only the first one's time runs

    // Is still at something that nobody waits for any more, or has stopped answering.
    bool Lagging() const { return stalled || unanswered.size() > leases.size(); }
    bool Idle() const { return leases.empty() && !Lagging(); }
    int InFlight() const;
    bool Wants(Eigen::Index count) const { return max_chunk == 0 || count <= max_chunk; }
  };

  // A query of the round that `worker` has or had, to be asked of another: nothing of the family
  // was compared with another's yet.
  struct Debt {
    WorkerId worker = 0;
    std::size_t block = 0;
    Eigen::Index query = 0;
    bool answered = false;  // by `worker`, and that counts
    LeaseId check = 0;      // of whoever is asked
    WorkerId checker = 0;
    bool taken = false;  // his answer is here, and not compared yet
  };

  bool IsCompared(WorkerId worker, const Family& family) const;
  void Owe(const Lease& lease);
  void Forget(WorkerId worker);
  bool IsBeingCompared(WorkerId worker, const Family& family) const;
  std::optional<WorkerId> PickChecker(const Debt& debt) const;
  Lease AskToCompare(Debt* debt, WorkerId checker, TimePoint now);
  // Until when the check of a debt is waited for; nothing: it is not.
  std::optional<TimePoint> Patience(const Debt& debt) const;
  Eigen::Index ShareOfTheRest(const Worker& worker) const;
  void Cut(const Worker& worker, Piece* piece, Lease* lease) const;
  bool MayHaveAnother(const Worker& worker) const;
  Worker* PickWorker(WorkerId* id);
  void TakeBack(Worker* worker, bool timed_out);
  Lease* Find(LeaseId id);
  Lease Give(WorkerId id, Lease lease, TimePoint now);
  std::optional<Lease> NextCheck(WorkerId id, Worker* worker) const;
  void BackUp(TimePoint now, std::vector<Lease>* leases);
  TimePoint EndOf(const Lease& lease) const;
  TimePoint OverdueAt(const Worker& worker, std::size_t position) const;
  // The most queries that an idle worker would take; 0: none is idle.
  Eigen::Index IdleRoom() const;

  DispatchOptions options_;
  bool active_ = false;
  bool timed_out_ = false;
  std::vector<Block> blocks_;
  std::deque<Piece> pending_;
  Eigen::Index pending_queries_ = 0;
  Eigen::Index unsettled_ = 0;
  std::map<WorkerId, Worker> workers_;
  std::vector<Debt> debts_;  // of the round; one at most for each worker and family
  LeaseId first_of_round_ = 1;
  LeaseId next_lease_ = 1;
  TimePoint deserted_since_;  // last moment with a worker, or the start of the round
  // The last chunk of the round given out, and the last one to any other worker: what to check by.
  std::optional<Lease> newest_, newest_other_;
};

}  // namespace stellate::server
