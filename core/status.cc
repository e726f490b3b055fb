#include "core/status.h"

namespace stellate::core {

const char* StatusCodeName(StatusCode code) {
  switch (code) {
    case StatusCode::kOk:
      return "OK";
    case StatusCode::kInvalidArgument:
      return "INVALID_ARGUMENT";
    case StatusCode::kLimitExceeded:
      return "LIMIT_EXCEEDED";
    case StatusCode::kNoSeeds:
      return "NO_SEEDS";
    case StatusCode::kOracleShape:
      return "ORACLE_SHAPE";
    case StatusCode::kOracleNotFinite:
      return "ORACLE_NOT_FINITE";
    case StatusCode::kOracleOffFlat:
      return "ORACLE_OFF_FLAT";
    case StatusCode::kOracleOutsideRadius:
      return "ORACLE_OUTSIDE_RADIUS";
    case StatusCode::kOracleBadTangent:
      return "ORACLE_BAD_TANGENT";
    case StatusCode::kOracleBadConormal:
      return "ORACLE_BAD_CONORMAL";
    case StatusCode::kOracleBadSize:
      return "ORACLE_BAD_SIZE";
    case StatusCode::kOracleNotIdempotent:
      return "ORACLE_NOT_IDEMPOTENT";
    case StatusCode::kOracleFailed:
      return "ORACLE_FAILED";
    case StatusCode::kFailedPrecondition:
      return "FAILED_PRECONDITION";
    case StatusCode::kCancelled:
      return "CANCELLED";
  }
  return "UNKNOWN";
}

}  // namespace stellate::core
