#include "server/session/examined_oracle.h"

#include <algorithm>
#include <utility>

#include "server/base/clock.h"

namespace stellate::server {
namespace {

using core::OracleFault;

OracleFault::Kind KindOf(const MeshFailure& failure) {
  const std::string& reason = failure.oracle_reason;
  if (failure.reason == FailureReason::kOracleShape || reason == "ORACLE_SHAPE")
    return OracleFault::Kind::kShape;
  if (reason == "ORACLE_NOT_FINITE") return OracleFault::Kind::kNotFinite;
  if (reason == "ORACLE_PRECISION") return OracleFault::Kind::kInexact;
  if (reason == "ORACLE_TOUCHES_ZERO") return OracleFault::Kind::kTouchesZero;
  if (reason == "ORACLE_DERIVATIVE") return OracleFault::Kind::kDerivative;
  return OracleFault::Kind::kRaised;
}

}  // namespace

bool IsFaultOfOracle(const MeshFailure& failure) {
  return failure.reason == FailureReason::kOracleFailed ||
         failure.reason == FailureReason::kOracleShape ||
         failure.reason == FailureReason::kAnswerTimeout;
}

// Reads the clock that the examination has not.
class ExaminedOracle::Mesher final : public core::Mesher {
 public:
  Mesher(std::shared_ptr<ExaminedOracle> oracle, core::Specification spec)
      : oracle_(std::move(oracle)), spec_(std::move(spec)) {
    progress_.phase = core::Phase::kCertifying;
  }

  std::shared_ptr<const core::QueryBatch> NextBatch() override {
    auto batch = IsOver() ? nullptr : oracle_->examiner_->NextBatch();
    if (batch == nullptr) End(core::Termination::kConverged);
    asked_ = Clock::now();
    return batch;
  }

  core::Expected<core::MeshDelta> Absorb(const core::Answers& answers) override {
    const std::chrono::duration<double> took = Clock::now() - asked_;
    core::Examiner& examiner = *oracle_->examiner_;
    core::Status status = examiner.Absorb(answers, took.count());
    if (!status.ok()) return tl::unexpected(std::move(status));
    oracle_->Publish();
    progress_.queries = examiner.report().queries;
    core::MeshDelta delta;
    delta.revision = ++progress_.round;
    delta.points.resize(spec_.ambient_dimension, 0);
    return delta;
  }

  void Interrupt() override {}  // what follows an answer takes a moment
  void Cancel() override { End(core::Termination::kCancelled); }
  void Fail(core::Status reason) override {
    if (!IsOver()) report_.failure = std::move(reason);
    End(core::Termination::kOracleFailed);
  }
  const core::Specification& specification() const override { return spec_; }
  const core::Progress& progress() const override { return progress_; }
  const core::Report& report() const override { return report_; }
  Eigen::Map<const Eigen::MatrixXd> Points() const override {
    return {nullptr, spec_.ambient_dimension, 0};
  }
  Eigen::MatrixXd Tangents() const override { return {}; }
  std::vector<std::uint32_t> Simplices() const override { return {}; }
  std::vector<std::int8_t> Labels() const override { return {}; }

 private:
  bool IsOver() const { return report_.termination != core::Termination::kRunning; }
  void End(core::Termination how) {
    if (!IsOver()) report_.termination = how;
  }

  const std::shared_ptr<ExaminedOracle> oracle_;
  const core::Specification spec_;
  core::Progress progress_;
  core::Report report_;
  TimePoint asked_;
};

ExaminedOracle::ExaminedOracle(core::Specification spec, std::optional<double> epsilon)
    : examiner_(core::Examiner::Create(std::move(spec), epsilon)) {
  Publish();
}

MesherFactory ExaminedOracle::Examiner() {
  return [self = shared_from_this()](core::Specification spec, core::Execution) {
    return core::Expected<std::unique_ptr<core::Mesher>>(
        std::make_unique<Mesher>(self, std::move(spec)));
  };
}

void ExaminedOracle::Publish() {
  const std::lock_guard lock(mutex_);
  for (const core::Finding& finding : examiner_->report().findings) {
    const bool is_known = std::any_of(published_.begin(), published_.end(),
                                      [&](const auto& old) { return old.code == finding.code; });
    if (!is_known) published_.push_back(finding);
  }
}

std::vector<core::Finding> ExaminedOracle::FindingsFrom(std::size_t first) const {
  const std::lock_guard lock(mutex_);
  first = std::min(first, published_.size());
  return {published_.begin() + static_cast<std::ptrdiff_t>(first), published_.end()};
}

core::ExaminationReport ExaminedOracle::Conclude(const MeshFailure& failure) {
  if (IsFaultOfOracle(failure)) examiner_->Fail({KindOf(failure), failure.message});
  Publish();
  return examiner_->report();
}

}  // namespace stellate::server
