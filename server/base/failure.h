#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "core/status.h"

namespace stellate::server {

// Why a mesh failed. Journals hold the names: one that goes stays, and a new one is a new version
// of the records.
enum class FailureReason {
  kNone,  // it did not
  // As core::StatusCode says.
  kInvalidArgument,
  kLimitExceeded,  // or the mesh grew beyond the memory that it may use
  kNoSeeds,
  kOracleShape,
  kOracleNotFinite,
  kOracleOffFlat,
  kOracleOutsideRadius,
  kOracleBadTangent,
  kOracleBadSize,
  kOracleBadConormal,
  kOracleNotIdempotent,
  kOracleFailed,
  kFailedPrecondition,
  kCancelled,
  // The server's own.
  kNoWorker,         // none came, or came back, in time
  kAnswerTimeout,    // an oracle never answered
  kWorkersDisagree,  // two of them answered one query differently
  kJournalFull,      // the disk, or what the journal may have of it
  kJournalFailed,    // the record cannot be written, or read back
  kReplayMismatch,   // recorded by a server that meshes otherwise
  kInternal,         // a fault of the server
};

// The name in errors.proto without its prefix; "" of kNone.
const char* FailureReasonName(FailureReason reason);
std::optional<FailureReason> FailureReasonOf(std::string_view name);  // nothing: no such name

struct MeshFailure {
  FailureReason reason = FailureReason::kNone;
  std::string message;          // for people
  std::string oracle_reason{};  // OracleFailure.reason; not recorded
};

// A refusal of the core, as what ends a mesh.
MeshFailure ToMeshFailure(const core::Status& status);

}  // namespace stellate::server
