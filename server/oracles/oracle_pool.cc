#include "server/oracles/oracle_pool.h"

#include <algorithm>
#include <utility>

#include "core/base/message.h"
#include "server/oracles/answer_check.h"
#include "server/oracles/seconds.h"

namespace stellate::server {
namespace {

using core::StatusCode;
using Eigen::Index;

}  // namespace

core::Answers EmptyAnswers(int dimension, const core::QueryBatch& batch, int walls) {
  core::Answers answers;
  for (const core::QueryBlock& block : batch.blocks)
    answers.blocks.push_back(core::AnswerBlock::Shape(dimension, walls, block, block.size()));
  return answers;
}

void PutAnswers(const PartOfRound& part, core::Answers* answers) {
  answers->blocks[part.block_index].Put(part.first, part.answers);
}

OraclePool::OraclePool(const core::Specification& spec, DispatchOptions options,
                       std::size_t max_workers, std::shared_ptr<PoolObserver> observer)
    : spec_(spec),
      options_(options),
      max_workers_(max_workers),
      observer_(std::move(observer)),
      dispatch_(options),
      signs_(spec) {}

Allowed<WorkerId> OraclePool::Join(std::shared_ptr<OracleWorker> worker, std::uint32_t max_chunk) {
  std::vector<Delivery> deliveries;
  WorkerId id = 0;
  {
    const std::lock_guard lock(mutex_);
    if (closed_) {
      return tl::unexpected(
          Refused({StatusCode::kFailedPrecondition,
                   "the mesh is over and asks nothing any more: create another"}));
    }
    if (members_.size() >= max_workers_) {
      return tl::unexpected(
          Refused({"max-workers", core::Message(max_workers_), "mesh"},
                  core::Message("the mesh has ", members_.size(),
                                " workers, the most that this server allows: let one go first, or "
                                "raise --max-workers")));
    }
    id = next_worker_++;
    display_names_[id] = worker->DisplayName();
    if (follower_ != nullptr) follower_->OnJoined(id, display_names_[id], worker->Trace());
    members_.emplace(id, std::move(worker));
    worker_count_ = members_.size();
    dispatch_.Join(id, max_chunk);
    deliveries = AssignLocked(Clock::now());
  }
  changed_.notify_one();
  Send(std::move(deliveries));
  return id;
}

void OraclePool::Leave(WorkerId worker) {
  std::vector<Delivery> deliveries;
  std::shared_ptr<OracleWorker> gone;
  {
    const std::lock_guard lock(mutex_);
    const auto it = members_.find(worker);
    if (it == members_.end()) return;
    gone = std::move(it->second);
    members_.erase(it);
    worker_count_ = members_.size();
    if (follower_ != nullptr) follower_->OnLeft(worker);
    const TimePoint now = Clock::now();
    dispatch_.Leave(worker, now);
    deliveries = AssignLocked(now);
  }
  changed_.notify_one();
  Send(std::move(deliveries));
}

core::Expected<std::optional<Chunk>> OraclePool::Accept(WorkerId worker, LeaseId lease_id) {
  std::vector<Delivery> deliveries;
  std::optional<Chunk> chunk;
  {
    const std::lock_guard lock(mutex_);
    const TimePoint now = Clock::now();
    Lease lease;
    const auto result = dispatch_.Accept(worker, lease_id, now, &lease);
    if (follower_ != nullptr) follower_->OnAnswered(lease_id, result);
    switch (result) {
      case Dispatch::AcceptResult::kUnknown:
        return core::Refuse(StatusCode::kInvalidArgument,
                            core::Message("answers.lease is ", lease_id,
                                          " but no such chunk is waiting for this worker's answer: "
                                          "answer each QueryChunk once, with its own lease"));
      case Dispatch::AcceptResult::kLate:
        break;
      case Dispatch::AcceptResult::kCounts:
      case Dispatch::AcceptResult::kForComparison:
        chunk = Chunk{lease.id,
                      round_,
                      lease.block,
                      lease.first,
                      lease.count,
                      worker,
                      result == Dispatch::AcceptResult::kForComparison};
        break;
    }
    deliveries = AssignLocked(now);
  }
  Send(std::move(deliveries));
  return chunk;
}

void OraclePool::Busy(WorkerId worker, LeaseId lease) {
  const std::lock_guard lock(mutex_);
  dispatch_.Busy(worker, lease, Clock::now());  // only postpones deadlines: no thread need wake up
}

Refused OraclePool::Deliver(const Chunk& chunk, const core::AnswerBlock& answer) {
  const auto check = options_.is_examination ? CheckAnswerShape : CheckAnswer;
  Refused checked = check(spec_, chunk, answer);
  if (!checked.ok()) return checked;
  if (chunk.for_comparison) {
    const auto compared = std::make_shared<const ComparedAnswer>(ComparedAnswer{chunk, answer});
    {
      const std::lock_guard lock(mutex_);
      if (round_ != chunk.round) return core::Status::Ok();
      compared_answers_.push_back(compared);
    }
    Compare(*compared, chunk.first, chunk.count);
  } else {
    Store(chunk, answer);
  }
  changed_.notify_one();
  return core::Status::Ok();
}

void OraclePool::Store(const Chunk& chunk, const core::AnswerBlock& answer) {
  chunk.round->answers.blocks[chunk.block_index].Put(chunk.first, answer);
  std::vector<std::shared_ptr<const ComparedAnswer>> compared;
  std::string contradiction;
  {
    const std::lock_guard lock(mutex_);
    if (round_ != chunk.round) return;
    if (spec_.walls > 0) {
      signs_.Learn(answer);
      contradiction = signs_.Verdict();
    }
    auto& by = round_->answered_by[chunk.block_index];
    std::fill_n(by.begin() + chunk.first, chunk.count, chunk.worker);
    compared = compared_answers_;
  }
  FailOnDisagreement(chunk, contradiction);
  // Before the round can end: answers that two workers disagree about must not enter a mesh.
  for (const auto& other_answer : compared) {
    const Chunk& other = other_answer->chunk;
    if (other.block_index != chunk.block_index) continue;
    const Index first = std::max(chunk.first, other.first);
    const Index end = std::min(chunk.first + chunk.count, other.first + other.count);
    if (first < end) Compare(*other_answer, first, end - first);
  }
  if (on_answered_) on_answered_(chunk.round, chunk.block_index, chunk.first, chunk.count);
  const std::lock_guard lock(mutex_);
  if (round_ == chunk.round) dispatch_.MarkAnswered(chunk.lease, chunk.count);
}

// Compares the queries of [first, first + count) that have another worker's answer already. The
// others follow when they have one.
void OraclePool::Compare(const ComparedAnswer& compared, Index first, Index count) {
  const Chunk& chunk = compared.chunk;
  std::vector<std::pair<Index, WorkerId>> others;
  {
    const std::lock_guard lock(mutex_);
    if (round_ != chunk.round) return;
    const auto& by = round_->answered_by[chunk.block_index];
    for (Index q = first; q < first + count; ++q) {
      const WorkerId other = by[static_cast<std::size_t>(q)];
      if (other != 0 && other != chunk.worker) others.push_back({q, other});
    }
  }
  // Stored answers do not change any more.
  const core::AnswerBlock& answers = chunk.round->answers.blocks[chunk.block_index];
  std::string words;
  for (const auto& [q, id] : others) {
    AnswerRef counted{"", &answers, q};
    AnswerRef own{"", &compared.answer, q - chunk.first};
    const bool agree = FindDisagreement(spec_, chunk.block(), q, counted, own).empty();
    if (agree && spec_.walls == 0) continue;
    const std::lock_guard lock(mutex_);
    counted.worker = NameLocked(id);
    own.worker = NameLocked(chunk.worker);
    if (agree) signs_.Compare(chunk.block(), q, counted, own);
    words = agree ? signs_.Verdict() : FindDisagreement(spec_, chunk.block(), q, counted, own);
    if (!words.empty()) break;
  }
  FailOnDisagreement(chunk, words);
  if (others.empty()) return;
  if (observer_ != nullptr) observer_->OnCompared(others.size());
  const std::lock_guard lock(mutex_);
  if (round_ != chunk.round) return;
  for (const auto& [q, id] : others) dispatch_.Compared(id, chunk.worker, chunk.block_index);
  changed_.notify_one();
}

void OraclePool::FailOnDisagreement(const Chunk& chunk, const std::string& words) {
  if (words.empty()) return;
  if (observer_ != nullptr) observer_->OnDisagreement();
  Fail(
      {FailureReason::kWorkersDisagree, core::Message("round ", chunk.round->batch->round,
                                                      ", block ", chunk.block_index, ", ", words)});
}

std::string OraclePool::NameLocked(WorkerId worker) const {
  const auto it = display_names_.find(worker);
  return it == display_names_.end() || it->second.empty()
             ? core::Message("worker number ", worker)
             : core::Message("worker number ", worker, " (", it->second, ")");
}

std::size_t OraclePool::waiting() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::size_t>(dispatch_.unanswered());
}

void OraclePool::Fail(MeshFailure failure) {
  {
    const std::lock_guard lock(mutex_);
    if (!failure_) failure_ = std::move(failure);
  }
  changed_.notify_one();
}

OraclePool::Outcome OraclePool::Ask(std::shared_ptr<const core::QueryBatch> batch,
                                    const std::function<void()>& meanwhile,
                                    const std::vector<PartOfRound>& known) {
  std::shared_ptr<Round> round = MakeRound(std::move(batch));
  for (const PartOfRound& part : known) PutAnswers(part, &round->answers);
  std::unique_lock lock(mutex_);
  round_ = round;
  std::erase_if(display_names_,
                [this](const auto& entry) { return !members_.contains(entry.first); });
  TimePoint now = Clock::now();
  dispatch_.Begin(Measure(*round->batch, known), now);
  auto first_deliveries = AssignLocked(now);
  lock.unlock();
  Send(std::move(first_deliveries));
  meanwhile();
  lock.lock();
  Outcome outcome;
  while (true) {
    now = Clock::now();
    dispatch_.Expire(now);
    if (!failure_ && dispatch_.failure(now) != Dispatch::Failure::kNone) {
      failure_ = Describe(dispatch_.failure(now));
    }
    if (interrupted_) break;
    if (failure_) {
      outcome.failure = failure_;
      break;
    }
    if (dispatch_.Done(now)) {
      outcome.round = std::move(round);
      break;
    }
    auto deliveries = AssignLocked(now);
    if (!deliveries.empty()) {
      lock.unlock();
      Send(std::move(deliveries));
      lock.lock();
      continue;
    }
    const TimePoint deadline = dispatch_.NextDeadline();
    if (deadline == TimePoint::max()) {
      changed_.wait(lock);  // an accepted answer is being checked: its worker's thread will notify
    } else {
      changed_.wait_until(lock, deadline);
    }
  }
  dispatch_.End();
  round_.reset();
  compared_answers_.clear();
  return outcome;
}

void OraclePool::Interrupt() {
  {
    const std::lock_guard lock(mutex_);
    interrupted_ = true;
  }
  changed_.notify_one();
}

void OraclePool::Shut() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
}

void OraclePool::Close(const WorkerEnd& end) {
  std::vector<std::shared_ptr<OracleWorker>> workers;
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    const TimePoint now = Clock::now();
    for (auto& [id, worker] : members_) {
      dispatch_.Leave(id, now);
      if (follower_ != nullptr) follower_->OnLeft(id);
      workers.push_back(std::move(worker));
    }
    members_.clear();
    worker_count_ = 0;
  }
  for (const auto& worker : workers) worker->End(end);
}

std::vector<OraclePool::Delivery> OraclePool::AssignLocked(TimePoint now) {
  std::vector<Delivery> deliveries;
  if (interrupted_ || failure_) return deliveries;
  std::size_t hedged = 0;
  for (const Lease& lease : dispatch_.Assign(now)) {
    if (lease.twin != 0) ++hedged;
    if (follower_ != nullptr) follower_->OnAsked(lease);
    deliveries.push_back({members_.at(lease.worker),
                          Chunk{lease.id, round_, lease.block, lease.first, lease.count}});
  }
  if (observer_ != nullptr && hedged > 0) observer_->OnHedged(hedged);
  return deliveries;
}

std::shared_ptr<Round> OraclePool::MakeRound(std::shared_ptr<const core::QueryBatch> batch) const {
  auto round = std::make_shared<Round>();
  round->answers = EmptyAnswers(spec_.dimension, *batch, spec_.walls);
  for (const core::QueryBlock& block : batch->blocks) {
    round->answered_by.emplace_back(static_cast<std::size_t>(block.size()), WorkerId{0});
  }
  round->batch = std::move(batch);
  return round;
}

std::vector<Dispatch::Block> OraclePool::Measure(const core::QueryBatch& batch,
                                                 const std::vector<PartOfRound>& known) const {
  std::vector<Dispatch::Block> blocks;
  for (const core::QueryBlock& block : batch.blocks) {
    const auto answer = core::AnswerBlock::Shape(spec_.dimension, spec_.walls, block, 1);
    blocks.push_back({block.size(),
                      std::max(core::BytesPerQuery(block), core::BytesPerQuery(answer)),
                      {static_cast<int>(block.kind), block.face}});
  }
  for (const PartOfRound& part : known) {
    const Index end = part.first + part.answers.points.cols();
    blocks[part.block_index].answered.push_back({part.first, end});
  }
  return blocks;
}

MeshFailure OraclePool::Describe(Dispatch::Failure failure) const {
  if (failure == Dispatch::Failure::kNoWorker) {
    return {FailureReason::kNoWorker,
            core::Message("no worker served the mesh for ", Seconds(options_.worker_wait),
                          " seconds (limits.worker_wait_seconds): open ServeOracle for it, or "
                          "allow a longer wait")};
  }
  return {FailureReason::kAnswerTimeout,
          core::Message("an oracle left a query that it was asked alone unanswered for ",
                        Seconds(options_.answer_limit), " seconds (limits.answer_seconds), or ",
                        Seconds(options_.busy_limit),
                        " while saying that it was busy (limits.busy_seconds), ",
                        options_.max_leases, " times: make it faster, or allow more time")};
}

void OraclePool::Send(std::vector<Delivery> deliveries) {
  for (Delivery& delivery : deliveries) delivery.worker->Ask(std::move(delivery.chunk));
}

}  // namespace stellate::server
