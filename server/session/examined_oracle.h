#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "core/examiner.h"
#include "core/specification.h"
#include "server/base/failure.h"
#include "server/session/session_options.h"

namespace stellate::server {

// The examination of an oracle, which a session runs in the place of a mesher.
//
//   const auto oracle = std::make_shared<ExaminedOracle>(spec, epsilon);
//   options.examiner = oracle->Examiner();
//   ... a Session with these options; meanwhile, on any thread, oracle->FindingsFrom(0)
//   const auto report = oracle->Conclude(session->View().failure);  // once it has ended
class ExaminedOracle : public std::enable_shared_from_this<ExaminedOracle> {
 public:
  ExaminedOracle(core::Specification spec, std::optional<double> epsilon);

  // Whether there is something to ask. Before the session runs, or once it has ended.
  bool asks() { return examiner_->NextBatch() != nullptr; }

  // A mesher that asks what the examination does, and inserts no point. It keeps this alive.
  MesherFactory Examiner();
  // Returns the findings from that one on, in the order in which they were made. Any thread.
  std::vector<core::Finding> FindingsFrom(std::size_t first) const;
  // Once the session has ended: returns what was found. If it ended by a fault of the oracle, that
  // is the last finding.
  core::ExaminationReport Conclude(const MeshFailure& failure);

 private:
  class Mesher;

  // Shows what was found since the last call.
  void Publish();

  const std::unique_ptr<core::Examiner> examiner_;  // the session's thread's, until it ends
  mutable std::mutex mutex_;
  std::vector<core::Finding> published_;
};

// Whether a mesh with this failure failed by what its oracle answered, or did not.
bool IsFaultOfOracle(const MeshFailure& failure);

}  // namespace stellate::server
