#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/mesher.h"
#include "core/reconstruction.h"
#include "server/history/mesh_history.h"
#include "server/points/points_request.h"

namespace stellate::server {

// A reconstruction as a run in rounds, so that its points are recorded, replayed and shown as a
// mesh's answers are. The questions of a round are the next rows of the points, about a megabyte of
// them: their coordinates in QueryBlock::points say nothing. The last round has no questions: it is
// answered when the client has said that the points are complete, and with it they are
// reconstructed from. Each round is a revision: the points in their order are the vertices, and the
// last one adds simplices, places and smoothed positions.
class PointRounds final : public core::Mesher {
 public:
  // `watch` and `places` outlive it; any thread may read the progress of `watch`. The last Absorb
  // fills `places`.
  PointRounds(const PointsRequest& request, core::Execution execution,
              core::ReconstructionWatch* watch, PointPlaces* places);

  std::shared_ptr<const core::QueryBatch> NextBatch() override;
  core::Expected<core::MeshDelta> Absorb(const core::Answers& answers) override;
  void Interrupt() override { watch_->Interrupt(); }
  void Cancel() override;
  void Fail(core::Status reason) override;
  const core::Specification& specification() const override { return specification_; }
  const core::Progress& progress() const override { return progress_; }
  const core::Report& report() const override { return report_; }
  // The points that have come; until the run is over, as they are the mesh's history's then.
  Eigen::Map<const Eigen::MatrixXd> Points() const override {
    return {cloud_.points.data(), cloud_.points.rows(),
            std::min(cloud_.points.cols(), static_cast<Eigen::Index>(progress_.vertices))};
  }
  Eigen::MatrixXd Tangents() const override {
    return cloud_.tangents.leftCols(std::min(cloud_.tangents.cols(), Points().cols()));
  }
  std::vector<std::uint32_t> Simplices() const override { return {}; }  // of that mesh
  std::vector<std::int8_t> Labels() const override { return {}; }

 private:
  core::Status Take(const core::AnswerBlock& rows, core::MeshDelta* delta);
  core::Status Reconstruct(core::MeshDelta* delta);
  void End(core::Termination termination);

  const PointsRequest request_;
  const core::Execution execution_;
  core::Specification specification_;  // its dimensions
  core::ReconstructionWatch* const watch_;
  PointPlaces* const places_;
  core::PointCloud cloud_;  // the first progress_.vertices of its columns are there
  std::shared_ptr<const core::QueryBatch> batch_;
  core::Progress progress_;
  core::Report report_;
};

}  // namespace stellate::server
