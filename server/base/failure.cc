#include "server/base/failure.h"

namespace stellate::server {
namespace {

using core::StatusCode;

struct Row {
  FailureReason reason;
  const char* name;
  std::optional<StatusCode> code = {};  // of the core's that leads to it
};

constexpr Row kRows[] = {
    {FailureReason::kNone, "", StatusCode::kOk},
    {FailureReason::kInvalidArgument, "INVALID_ARGUMENT", StatusCode::kInvalidArgument},
    {FailureReason::kLimitExceeded, "LIMIT_EXCEEDED", StatusCode::kLimitExceeded},
    {FailureReason::kNoSeeds, "NO_SEEDS", StatusCode::kNoSeeds},
    {FailureReason::kOracleShape, "ORACLE_SHAPE", StatusCode::kOracleShape},
    {FailureReason::kOracleNotFinite, "ORACLE_NOT_FINITE", StatusCode::kOracleNotFinite},
    {FailureReason::kOracleOffFlat, "ORACLE_OFF_FLAT", StatusCode::kOracleOffFlat},
    {FailureReason::kOracleOutsideRadius, "ORACLE_OUTSIDE_RADIUS",
     StatusCode::kOracleOutsideRadius},
    {FailureReason::kOracleBadTangent, "ORACLE_BAD_TANGENT", StatusCode::kOracleBadTangent},
    {FailureReason::kOracleBadSize, "ORACLE_BAD_SIZE", StatusCode::kOracleBadSize},
    {FailureReason::kOracleBadConormal, "ORACLE_BAD_CONORMAL", StatusCode::kOracleBadConormal},
    {FailureReason::kOracleNotIdempotent, "ORACLE_NOT_IDEMPOTENT",
     StatusCode::kOracleNotIdempotent},
    {FailureReason::kOracleFailed, "ORACLE_FAILED", StatusCode::kOracleFailed},
    {FailureReason::kFailedPrecondition, "FAILED_PRECONDITION", StatusCode::kFailedPrecondition},
    {FailureReason::kCancelled, "CANCELLED", StatusCode::kCancelled},
    {FailureReason::kNoWorker, "NO_WORKER"},
    {FailureReason::kAnswerTimeout, "ANSWER_TIMEOUT"},
    {FailureReason::kWorkersDisagree, "WORKERS_DISAGREE"},
    {FailureReason::kJournalFull, "JOURNAL_FULL"},
    {FailureReason::kJournalFailed, "JOURNAL_FAILED"},
    {FailureReason::kReplayMismatch, "REPLAY_MISMATCH"},
    {FailureReason::kInternal, "INTERNAL"},
};

}  // namespace

const char* FailureReasonName(FailureReason reason) {
  for (const Row& row : kRows) {
    if (row.reason == reason) return row.name;
  }
  return "INTERNAL";
}

std::optional<FailureReason> FailureReasonOf(std::string_view name) {
  for (const Row& row : kRows) {
    if (row.name == name) return row.reason;
  }
  return std::nullopt;
}

MeshFailure ToMeshFailure(const core::Status& status) {
  for (const Row& row : kRows) {
    if (row.code == status.code) return {row.reason, status.message};
  }
  return {FailureReason::kInternal, status.message};
}

}  // namespace stellate::server
