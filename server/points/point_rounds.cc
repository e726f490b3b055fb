#include "server/points/point_rounds.h"

#include <algorithm>
#include <utility>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;
using core::StatusCode;
using Eigen::Index;

constexpr std::uint64_t kRoundBytes = std::uint64_t{1} << 20;

// The share of the work that it is to receive the points, for the progress.
constexpr double kUploadShare = 0.2;

}  // namespace

PointRounds::PointRounds(const PointsRequest& request, core::Execution execution,
                         core::ReconstructionWatch* watch, PointPlaces* places)
    : request_(request), execution_(execution), watch_(watch), places_(places) {
  specification_.dimension = request_.spec.dimension;
  specification_.ambient_dimension = request_.spec.ambient_dimension;
  const auto n = static_cast<Index>(request_.points);
  cloud_.points.resize(request_.spec.ambient_dimension, n);
  if (request_.has_tangents) {
    cloud_.tangents.resize(request_.spec.ambient_dimension * request_.spec.dimension, n);
  }
}

std::shared_ptr<const core::QueryBatch> PointRounds::NextBatch() {
  if (batch_ != nullptr || report_.termination != core::Termination::kRunning) return batch_;
  auto batch = std::make_shared<core::QueryBatch>();
  batch->round = progress_.round + 1;
  const std::uint64_t rows =
      std::min(request_.points - progress_.vertices,
               std::max<std::uint64_t>(kRoundBytes / BytesOfPoint(request_), 1));
  if (rows > 0) {
    core::QueryBlock& block = batch->blocks.emplace_back();
    block.points.setZero(request_.spec.ambient_dimension, static_cast<Index>(rows));
    block.want.tangents = request_.has_tangents;
  }
  batch_ = std::move(batch);
  return batch_;
}

core::Expected<core::MeshDelta> PointRounds::Absorb(const core::Answers& answers) {
  if (batch_ == nullptr || answers.blocks.size() != batch_->blocks.size()) {
    return core::Refuse(StatusCode::kFailedPrecondition, "these are not the points asked for");
  }
  core::MeshDelta delta;
  delta.revision = batch_->round;
  delta.first_vertex = progress_.vertices;
  const Status status =
      answers.blocks.empty() ? Reconstruct(&delta) : Take(answers.blocks.front(), &delta);
  if (!status.ok()) return tl::unexpected(status);
  progress_.round = delta.revision;
  batch_.reset();
  return delta;
}

Status PointRounds::Take(const core::AnswerBlock& rows, core::MeshDelta* delta) {
  const core::QueryBlock& asked = batch_->blocks.front();
  if (rows.points.cols() != asked.size() || rows.points.rows() != asked.points.rows() ||
      rows.tangents.cols() != (request_.has_tangents ? asked.size() : 0)) {
    return {StatusCode::kFailedPrecondition, "these are not the points asked for"};
  }
  const auto first = static_cast<Index>(progress_.vertices);
  cloud_.points.middleCols(first, asked.size()) = rows.points;
  if (request_.has_tangents) cloud_.tangents.middleCols(first, asked.size()) = rows.tangents;
  delta->points = rows.points;
  progress_.vertices += static_cast<std::uint64_t>(asked.size());
  report_.counts.vertices = progress_.vertices;
  progress_.fraction =
      kUploadShare * static_cast<double>(progress_.vertices) / static_cast<double>(request_.points);
  return Status::Ok();
}

Status PointRounds::Reconstruct(core::MeshDelta* delta) {
  auto made = core::Reconstruct(request_.spec, cloud_, execution_, watch_);
  if (!made) return std::move(made.error());
  cloud_ = {};
  delta->points = std::move(made->added);
  progress_.vertices += static_cast<std::uint64_t>(delta->points.cols());
  delta->added = std::move(made->simplices);
  for (const core::Place place : made->places) {
    places_->codes.push_back(static_cast<std::uint8_t>(place));
  }
  places_->smoothed = std::move(made->smoothed);
  report_ = std::move(made->report);
  progress_.simplices = report_.counts.simplices;
  progress_.fraction = 1;
  End(report_.termination);
  return Status::Ok();
}

void PointRounds::Cancel() {
  if (report_.termination == core::Termination::kRunning) End(core::Termination::kCancelled);
}

void PointRounds::Fail(Status reason) {
  if (report_.termination != core::Termination::kRunning) return;
  report_.failure = std::move(reason);
  End(core::Termination::kOracleFailed);
}

void PointRounds::End(core::Termination termination) {
  report_.termination = termination;
  progress_.phase = core::Phase::kDone;
  cloud_ = {};
  batch_.reset();
}

}  // namespace stellate::server
