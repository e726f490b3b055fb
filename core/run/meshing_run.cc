#include "core/run/meshing_run.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/arenas.h"
#include "core/base/message.h"
#include "core/base/parallel.h"

namespace stellate::core {
namespace {

// CheckAnswers for a whole block, in parallel.
Status CheckInParts(const Specification& spec, const QueryBlock& block, const AnswerBlock& answer) {
  constexpr Eigen::Index kPart = 1024;  // queries
  if (Status s = CheckAnswerShape(spec, block, 0, answer); !s.ok()) return s;
  const Eigen::Index count = answer.points.cols();
  std::vector<Status> parts(static_cast<std::size_t>((count + kPart - 1) / kPart));
  ParallelFor(parts.size(), [&](std::size_t part) {
    const Eigen::Index first = static_cast<Eigen::Index>(part) * kPart;
    parts[part] =
        CheckAnswers(spec, block, first, answer.Rows(first, std::min(kPart, count - first)));
  });
  const auto refused =
      std::find_if(parts.begin(), parts.end(), [](const Status& s) { return !s.ok(); });
  return refused == parts.end() ? Status::Ok() : *refused;
}

}  // namespace

template <int K>
MeshingRun<K>::MeshingRun(Specification spec, const Peers& peers, Execution execution)
    : spec_(std::move(spec)),
      execution_(execution),
      scheduler_(spec_, interruption_, peers),
      mesh_(scheduler_.engine()) {
  OpenRound();
}

// Goes to the next batch, if the run is not over.
template <int K>
void MeshingRun<K>::OpenRound() {
  if (std::vector<QueryBlock> blocks = scheduler_.Questions(); !blocks.empty())
    batch_ = std::make_shared<QueryBatch>(QueryBatch{0, std::move(blocks)});
}

// Returns the batch that the client answers: the round's, or a part of it.
template <int K>
const std::shared_ptr<QueryBatch>& MeshingRun<K>::OpenBatch() {
  const std::uint64_t most = spec_.limits.max_batch_queries;
  if (most == 0 || static_cast<std::uint64_t>(batch_->size()) <= most) return batch_;
  if (!parts_) parts_.emplace(spec_, *batch_, most);
  return parts_->part();
}

template <int K>
std::shared_ptr<const QueryBatch> MeshingRun<K>::NextBatch() {
  if (!batch_) return nullptr;
  const std::shared_ptr<QueryBatch>& batch = OpenBatch();
  batch->round = progress_.round + 1;
  return batch;
}

template <int K>
Status MeshingRun<K>::Check(const QueryBatch& asked, const Answers& answers) const {
  if (answers.blocks.size() != asked.blocks.size())
    return {StatusCode::kOracleShape,
            Message("got ", answers.blocks.size(), " answer blocks for ", asked.blocks.size(),
                    " query blocks; send one for each")};
  for (std::size_t b = 0; b < answers.blocks.size(); ++b) {
    const QueryBlock& block = asked.blocks[b];
    if (answers.blocks[b].points.cols() != block.size())
      return {StatusCode::kOracleShape,
              Message("block ", b, " has ", answers.blocks[b].points.cols(), " answers for ",
                      block.size(), " queries; send one for each")};
    if (Status s = CheckInParts(spec_, block, answers.blocks[b]); !s.ok()) return s;
  }
  return Status::Ok();
}

template <int K>
void MeshingRun<K>::Count(const QueryBatch& asked) {
  const auto size = static_cast<std::uint64_t>(asked.size());
  ++progress_.round;
  progress_.queries += size;
  scheduler_.CountQueries(size);
}

template <int K>
Expected<MeshDelta> MeshingRun<K>::Absorb(const Answers& answers) {
  if (!batch_)
    return Refuse(StatusCode::kFailedPrecondition, "Absorb without a batch: the run is over");
  const std::shared_ptr<const QueryBatch> batch = OpenBatch();
  const QueryBatch& asked = *batch;
  Status status = {StatusCode::kCancelled, "the computation was interrupted"};
  WithThreads(execution_.threads, interruption_, [&] { status = Check(asked, answers); });
  if (!status.ok()) return tl::unexpected<Status>(status);
  const bool complete = !parts_ || parts_->is_last();
  const std::optional<Answers> joined =
      complete && parts_ ? std::optional(parts_->With(answers)) : std::nullopt;
  const Answers& all = joined ? *joined : answers;
  if (complete)
    if (Status s = scheduler_.Judge(all); !s.ok()) return tl::unexpected<Status>(s);

  const Progress progress_before = progress_;
  const Report report_before = report_;
  Count(asked);
  MeshDelta delta;
  delta.revision = progress_.round;
  delta.first_vertex = scheduler_.engine().stars().size();
  if (complete) {
    parts_.reset();
    batch_.reset();
  }
  const auto advance = [&] {
    if (complete) {
      scheduler_.Absorb(all.blocks);
      OpenRound();
    } else {
      parts_->Take(answers);
    }
    if (progress_.round >= spec_.limits.max_rounds) scheduler_.Finish(Termination::kRoundBudget);
    if (complete) mesh_.Update(&delta);
    Update();
  };
  if (!WithThreads(execution_.threads, interruption_, advance)) {
    // The run may just have ended, but no caller has seen that.
    scheduler_.Reopen();
    progress_ = progress_before;
    report_ = report_before;
    return Refuse(StatusCode::kCancelled, "the computation was interrupted");
  }
  mesh_.Add(scheduler_.TakeChange(), &delta);
  return delta;
}

template <int K>
void MeshingRun<K>::Finish(Termination termination, Status failure) {
  if (scheduler_.outcome()) return;
  scheduler_.Finish(termination, std::move(failure));
  Update();
}

// Brings progress and report up to date after a round, or an end.
template <int K>
void MeshingRun<K>::Update() {
  // An interrupted round leaves a mesh that was never reported.
  const bool is_whole = !interruption_.raised();
  if (is_whole) report_.counts = scheduler_.counts();
  const std::optional<Outcome>& outcome = scheduler_.outcome();
  if (!outcome) {
    scheduler_.Measure(&progress_);
    progress_.simplices = mesh_.size();
    return;
  }
  parts_.reset();
  batch_.reset();
  report_.termination = outcome->termination;
  report_.failure = outcome->failure;
  report_.certificate = outcome->certificate;
  progress_.phase = Phase::kDone;
  if (is_whole) {
    const Engine<K>& engine = scheduler_.engine();
    progress_.is_foreseeable = false;
    progress_.vertices = engine.stars().size();
    progress_.simplices = mesh_.size();
    progress_.bad_sliver = engine.violations().slivers();
    progress_.bad_inconsistent = engine.violations().inconsistent();
    progress_.bad_protection = engine.protection().weak();
    if (report_.termination == Termination::kConverged) progress_.fraction = 1;
  }
  report_.counts.vertices = progress_.vertices;
  report_.counts.simplices = progress_.simplices;
}

STELLATE_INSTANTIATE_CLASS(MeshingRun)

}  // namespace stellate::core
