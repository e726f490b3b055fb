#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"
#include "core/mesher.h"
#include "core/run/batch_parts.h"
#include "core/run/output_mesh.h"
#include "core/run/scheduler.h"

namespace stellate::core {

// Keeps mesher.h's contract around a Scheduler, for one k: hands out its queries as batches, checks
// the answers before anything depends on them, and reports. Use it through Mesher::Create.
template <int K>
class MeshingRun final : public Mesher {
 public:
  // `peers` is borrowed.
  MeshingRun(Specification spec, const Peers& peers, Execution execution);

  std::shared_ptr<const QueryBatch> NextBatch() override;
  Expected<MeshDelta> Absorb(const Answers& answers) override;
  void Interrupt() override { interruption_.Raise(); }
  void Cancel() override { Finish(Termination::kCancelled, Status::Ok()); }
  void Fail(Status reason) override { Finish(Termination::kOracleFailed, std::move(reason)); }

  const Specification& specification() const override { return spec_; }
  const Progress& progress() const override { return progress_; }
  const Report& report() const override { return report_; }
  Eigen::Map<const Eigen::MatrixXd> Points() const override { return mesh_.Points(); }
  Eigen::MatrixXd Tangents() const override {
    return scheduler_.engine().stars().sample().TangentMatrix();
  }
  std::vector<std::uint32_t> Simplices() const override { return mesh_.Simplices(); }
  std::vector<std::int8_t> Labels() const override { return mesh_.Labels(); }

 private:
  const std::shared_ptr<QueryBatch>& OpenBatch();
  void OpenRound();
  Status Check(const QueryBatch& asked, const Answers& answers) const;
  void Count(const QueryBatch& asked);
  void Finish(Termination termination, Status failure);
  void Update();

  const Specification spec_;
  const Execution execution_;
  Interruption interruption_;
  Scheduler<K> scheduler_;
  OutputMesh<K> mesh_;
  std::shared_ptr<QueryBatch> batch_;  // of the open round; null: there is none
  std::optional<BatchParts> parts_;    // of batch_, if that is too large for one batch
  Progress progress_;
  Report report_;
};

STELLATE_DECLARE_CLASS(MeshingRun)

}  // namespace stellate::core
