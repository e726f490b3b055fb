#include "server/points/point_intake.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;
using core::StatusCode;
using Eigen::Index;

Status Wrong(std::string message, const char* field) {
  return {StatusCode::kInvalidArgument, std::move(message), field};
}

// (d k) x m, as core::PointCloud::tangents.
Status CheckTangents(const PointsPart& part, int d, int k) {
  using Basis =
      Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  for (Index row = 0; row < part.tangents.cols(); ++row) {
    const Basis basis(part.tangents.col(row).data(), d, k);
    const double off =
        (basis.transpose() * basis - Eigen::MatrixXd::Identity(k, k)).cwiseAbs().maxCoeff();
    if (basis.allFinite() && off <= core::kOrthonormalTolerance) continue;
    return Wrong(
        Message("the tangent basis of row ", part.first_row + static_cast<std::uint64_t>(row),
                " is not orthonormal: T^t T differs from the identity by ", off, ", and may by ",
                core::kOrthonormalTolerance),
        "points.tangents");
  }
  return Status::Ok();
}

}  // namespace

PointIntake::PointIntake(const PointsRequest& request, Clock::duration patience)
    : request_(request), patience_(patience) {}

Status PointIntake::Join(std::shared_ptr<PointStream> stream) {
  std::shared_ptr<PointStream> older, welcome;
  {
    const std::lock_guard lock(mutex_);
    if (state_ == State::kOver) return {StatusCode::kFailedPrecondition, "the mesh is over"};
    older = std::exchange(stream_, std::move(stream));
    next_.reset();
    end_.reset();
    // What an older one offered is taken first.
    if (state_ != State::kReplaying && !part_) welcome = stream_;
  }
  changed_.notify_all();
  if (welcome != nullptr) welcome->Proceed();
  if (older != nullptr) {
    older->End({StatusCode::kFailedPrecondition,
                "another stream goes on with the points of this mesh: leave it to that"});
  }
  return Status::Ok();
}

void PointIntake::Leave(const PointStream* stream) {
  const std::lock_guard lock(mutex_);
  if (stream_.get() != stream) return;
  stream_.reset();
  alone_since_ = Clock::now();
  changed_.notify_all();
}

// What a part can be asked without knowing what came before.
Status PointIntake::Check(const PointsPart& part) const {
  const int d = request_.spec.ambient_dimension;
  for (Index row = 0; row < part.points.cols(); ++row) {
    const auto column = part.points.col(row);
    if (column.allFinite()) continue;
    Index at = 0;
    while (std::isfinite(column[at])) ++at;
    return Wrong(
        Message("coordinate ", at, " of row ", part.first_row + static_cast<std::uint64_t>(row),
                " is ", column[at], ": send finite numbers"),
        "points.points");
  }
  return request_.has_tangents ? CheckTangents(part, d, request_.spec.dimension) : Status::Ok();
}

Status PointIntake::Offer(const PointStream* stream, PointsPart part) {
  if (Status status = Check(part); !status.ok()) return status;
  const auto count = static_cast<std::uint64_t>(part.points.cols());
  std::shared_ptr<PointStream> has_more;  // for the part is known already
  {
    const std::lock_guard lock(mutex_);
    if (stream_.get() != stream) return Status::Ok();  // it has been ended
    if (part_) {
      return {StatusCode::kFailedPrecondition, "a part came before the one before it was taken"};
    }
    if (count > request_.points || part.first_row > request_.points - count) {
      return Wrong(Message("rows ", part.first_row, " to ", part.first_row + count - 1,
                           " came, but the specification announced ", request_.points, " points"),
                   "points.first_row");
    }
    const std::uint64_t next = next_.value_or(std::min(part.first_row, due_));
    if (part.first_row != next) {
      return Wrong(
          Message("a part begins with row ", part.first_row, " but row ", next_.value_or(due_),
                  " is the next: send the rows in order, without a gap or an overlap"),
          "points.first_row");
    }
    next_ = part.first_row + count;
    const std::uint64_t known = std::min(due_ - part.first_row, count);
    if (known == count) {
      has_more = stream_;
    } else {
      due_ = part.first_row + count;
      taken_ = static_cast<Index>(known);
      part_ = std::move(part);
    }
  }
  changed_.notify_all();
  if (has_more != nullptr) has_more->Proceed();
  return Status::Ok();
}

Status PointIntake::OfferEnd(const PointStream* stream, PointDigests digests) {
  std::shared_ptr<PointStream> done;
  {
    const std::lock_guard lock(mutex_);
    if (stream_.get() != stream) return Status::Ok();
    if (due_ < request_.points) {
      return Wrong(Message("the end came after ", due_, " points, but the specification announced ",
                           request_.points, ": send the others first"),
                   "end");
    }
    if (state_ != State::kComplete) {
      end_ = std::move(digests);
    } else {
      if (auto wrong = WrongDigestLocked(digests)) return Wrong(std::move(*wrong), "end");
      done = std::exchange(stream_, nullptr);
    }
  }
  changed_.notify_all();
  if (done != nullptr) done->End(Status::Ok());
  return Status::Ok();
}

std::optional<std::string> PointIntake::WrongDigestLocked(const PointDigests& digests) const {
  const auto compare = [](const char* what, const std::string& said,
                          const Sha256& found) -> std::optional<std::string> {
    const std::string value = found.Value();
    if (said == value) return std::nullopt;
    return Message("the SHA-256 of the ", what, " that came is ", Hexadecimal(value),
                   " but the client's is ", said.empty() ? "missing" : Hexadecimal(said),
                   ": they are not what was meant; delete the mesh and send them again");
  };
  if (auto wrong = compare("points", digests.points, points_digest_)) return wrong;
  if (!request_.has_tangents) return std::nullopt;
  return compare("tangents", digests.tangents, tangents_digest_);
}

// Waits for something to change; a failure if no stream came in time.
std::optional<MeshFailure> PointIntake::WaitLocked(std::unique_lock<std::mutex>& lock) {
  if (stream_ != nullptr) {
    changed_.wait(lock);
    return std::nullopt;
  }
  const TimePoint deadline = alone_since_ + patience_;
  if (Clock::now() < deadline) {
    changed_.wait_until(lock, deadline);
    return std::nullopt;
  }
  const double seconds = std::chrono::duration<double>(patience_).count();
  return MeshFailure{
      FailureReason::kNoWorker,
      Message("no client sent points for ", seconds, " seconds (limits.worker_wait_seconds), and ",
              recorded_, " of ", request_.points,
              " had come: send them again, or allow a longer wait")};
}

// (locked) Moves rows of the part into the block. Returns the stream that is to be told to proceed.
std::shared_ptr<PointStream> PointIntake::TakeSome(core::AnswerBlock* block, Index* filled) {
  const Index some = std::min(block->points.cols() - *filled, part_->points.cols() - taken_);
  block->points.middleCols(*filled, some) = part_->points.middleCols(taken_, some);
  if (request_.has_tangents) {
    block->tangents.middleCols(*filled, some) = part_->tangents.middleCols(taken_, some);
  }
  *filled += some;
  taken_ += some;
  if (taken_ < part_->points.cols()) return nullptr;
  part_.reset();
  return stream_;
}

// The replay is over: waits count from now, and a stream that joined before may proceed.
void PointIntake::Begin() {
  std::shared_ptr<PointStream> welcome;
  {
    const std::lock_guard lock(mutex_);
    if (state_ != State::kReplaying) return;
    state_ = State::kTaking;
    alone_since_ = Clock::now();
    due_ = std::max(due_, asked_);
    welcome = stream_;
  }
  if (welcome != nullptr) welcome->Proceed();
}

PointIntake::Outcome PointIntake::Ask(const core::QueryBatch& batch) {
  Outcome outcome;
  core::Answers answers;
  for (const core::QueryBlock& block : batch.blocks) {
    answers.blocks.push_back(
        core::AnswerBlock::Shape(request_.spec.dimension, 0, block, block.size()));
  }
  Index filled = 0;
  Begin();
  std::unique_lock lock(mutex_);
  while (state_ == State::kTaking) {
    if (!answers.blocks.empty() && part_) {
      const auto stream = TakeSome(&answers.blocks.front(), &filled);
      const bool is_full = filled == answers.blocks.front().points.cols();
      if (is_full) asked_ += static_cast<std::uint64_t>(filled);
      lock.unlock();
      if (stream != nullptr) stream->Proceed();
      if (is_full) return {std::move(answers), {}};
      lock.lock();
    } else if (answers.blocks.empty() && end_) {
      const auto wrong = WrongDigestLocked(*std::exchange(end_, std::nullopt));
      if (!wrong) return {std::move(answers), {}};
      const auto stream = std::exchange(stream_, nullptr);
      alone_since_ = Clock::now();
      lock.unlock();
      if (stream != nullptr) stream->End(Wrong(*wrong, "end"));
      lock.lock();
    } else {
      outcome.failure = WaitLocked(lock);
      if (outcome.failure) return outcome;
    }
  }
  return outcome;
}

void PointIntake::Note(const core::Answers& answers) {
  std::shared_ptr<PointStream> done;
  {
    const std::lock_guard lock(mutex_);
    for (const core::AnswerBlock& block : answers.blocks) {
      const auto bytes = [](const Eigen::MatrixXd& matrix) {
        return static_cast<std::size_t>(matrix.size()) * sizeof(double);
      };
      points_digest_.Add(block.points.data(), bytes(block.points));
      tangents_digest_.Add(block.tangents.data(), bytes(block.tangents));
      recorded_ += static_cast<std::uint64_t>(block.points.cols());
    }
    // A replayed round was neither offered nor asked for here.
    due_ = std::max(due_, recorded_);
    asked_ = std::max(asked_, recorded_);
    if (answers.blocks.empty()) {
      if (state_ != State::kOver) state_ = State::kComplete;
      done = std::exchange(stream_, nullptr);
    }
  }
  if (done != nullptr) done->End(Status::Ok());
}

void PointIntake::Interrupt() {
  const std::lock_guard lock(mutex_);
  state_ = State::kOver;
  changed_.notify_all();
}

void PointIntake::Close(const Status& blame) {
  std::shared_ptr<PointStream> stream;
  {
    const std::lock_guard lock(mutex_);
    state_ = State::kOver;
    stream = std::exchange(stream_, nullptr);
  }
  changed_.notify_all();
  if (stream == nullptr) return;
  stream->End(blame.ok() ? Status{StatusCode::kFailedPrecondition,
                                  "the mesh ended before its points were complete"}
                         : blame);
}

std::uint64_t PointIntake::rows() const {
  const std::lock_guard lock(mutex_);
  return recorded_;
}

bool PointIntake::is_complete() const {
  const std::lock_guard lock(mutex_);
  return state_ == State::kComplete;
}

bool PointIntake::is_joined() const {
  const std::lock_guard lock(mutex_);
  return stream_ != nullptr;
}

void PointIntake::Show(core::Progress* progress) const {
  const core::ReconstructionProgress now = watch_.progress();
  if (!is_complete() || progress->phase == core::Phase::kDone) return;
  progress->phase = now.phase < core::ReconstructionPhase::kCertifying ? core::Phase::kRefining
                                                                       : core::Phase::kCertifying;
  // What is left of the work after the upload (PointRounds).
  progress->fraction += (1 - progress->fraction) * now.fraction;
  progress->is_foreseeable = now.fraction > 0;
}

}  // namespace stellate::server
