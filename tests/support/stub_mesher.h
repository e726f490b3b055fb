#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "core/mesher.h"

namespace stellate::testing {

// A mesher without a mesh, for tests of what drives one: it can be ended, and says how it stands.
// What it asks and what it makes of the answers is each test's own.
class StubMesher : public core::Mesher {
 public:
  explicit StubMesher(core::Specification spec) : spec_(std::move(spec)) {
    batch_->round = 1;
    batch_->blocks.resize(1);
    batch_->blocks[0].points = Eigen::MatrixXd::Constant(spec_.ambient_dimension, 1, 1.0);
  }

  void Interrupt() override {}
  void Cancel() override { End(core::Termination::kCancelled); }
  void Fail(core::Status reason) override {
    if (!IsOver()) report_.failure = std::move(reason);
    End(core::Termination::kOracleFailed);
  }
  const core::Specification& specification() const override { return spec_; }
  const core::Progress& progress() const override { return progress_; }
  const core::Report& report() const override { return report_; }
  Eigen::Map<const Eigen::MatrixXd> Points() const override { return {nullptr, 0, 0}; }
  Eigen::MatrixXd Tangents() const override { return {}; }
  std::vector<std::uint32_t> Simplices() const override { return {}; }
  std::vector<std::int8_t> Labels() const override { return {}; }

 protected:
  bool IsOver() const { return report_.termination != core::Termination::kRunning; }
  // No effect once it is over.
  void End(core::Termination how) {
    if (!IsOver()) report_.termination = how;
  }

  std::shared_ptr<core::QueryBatch> batch_ = std::make_shared<core::QueryBatch>();  // one point
  core::Progress progress_;
  core::Report report_;

 private:
  const core::Specification spec_;
};

}  // namespace stellate::testing
