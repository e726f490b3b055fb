#pragma once

#include "server/session/session_journal.h"

namespace stellate::server::testing {

// Takes everything and knows nothing.
class BlankJournal : public SessionJournal {
 public:
  std::optional<MeshFailure> WriteStart(const MeshRequest&,
                                        std::chrono::system_clock::time_point) override {
    return std::nullopt;
  }
  Known BeginRound(const core::QueryBatch&) override { return {}; }
  void TakeAnswers(const std::shared_ptr<const Round>&, std::size_t, Eigen::Index,
                   Eigen::Index) override {}
  std::optional<MeshFailure> WriteRound(const core::QueryBatch&, const core::Answers&,
                                        const Standing&) override {
    return std::nullopt;
  }
  std::optional<MeshFailure> WriteEnd(const SessionEnd&) override { return std::nullopt; }
  std::optional<MeshFailure> WriteResult(const SessionResult&, const MeshHistory&) override {
    return std::nullopt;
  }
  core::Expected<std::unique_ptr<MeshHistory>> ReadHistory() override {
    return core::Refuse(core::StatusCode::kFailedPrecondition, "there is none");
  }
  void Forget() override {}
};

}  // namespace stellate::server::testing
