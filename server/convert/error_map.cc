#include "server/convert/error_map.h"

#include <string_view>

#include "stellate/rpc/status_details.pb.h"

namespace stellate::server {
namespace {

// Trailers may hold 8 KB. A message stands in them up to three times: percent-encoded, and in the
// base64 details with the field at fault.
constexpr std::size_t kMaxMessageBytes = 800;
constexpr std::string_view kReasonPrefix = "ERROR_REASON_";

struct ReasonRow {
  v1::ErrorReason reason;
  grpc::StatusCode code;
};

constexpr ReasonRow kCodes[] = {
    {v1::ERROR_REASON_INVALID_ARGUMENT, grpc::StatusCode::INVALID_ARGUMENT},
    {v1::ERROR_REASON_LIMIT_EXCEEDED, grpc::StatusCode::RESOURCE_EXHAUSTED},
    {v1::ERROR_REASON_MESH_NOT_FOUND, grpc::StatusCode::NOT_FOUND},
    {v1::ERROR_REASON_FAILED_PRECONDITION, grpc::StatusCode::FAILED_PRECONDITION},
    {v1::ERROR_REASON_OUT_OF_ORDER, grpc::StatusCode::INVALID_ARGUMENT},
    {v1::ERROR_REASON_SHUTTING_DOWN, grpc::StatusCode::UNAVAILABLE},
    {v1::ERROR_REASON_REVISION_TOO_NEW, grpc::StatusCode::OUT_OF_RANGE},
    {v1::ERROR_REASON_UNAUTHENTICATED, grpc::StatusCode::UNAUTHENTICATED},
    {v1::ERROR_REASON_ORACLE_SHAPE, grpc::StatusCode::INVALID_ARGUMENT},
    {v1::ERROR_REASON_ORACLE_NOT_FINITE, grpc::StatusCode::INVALID_ARGUMENT},
    {v1::ERROR_REASON_ORACLE_OFF_FLAT, grpc::StatusCode::INVALID_ARGUMENT},
    {v1::ERROR_REASON_ORACLE_OUTSIDE_RADIUS, grpc::StatusCode::INVALID_ARGUMENT},
    {v1::ERROR_REASON_ORACLE_BAD_TANGENT, grpc::StatusCode::INVALID_ARGUMENT},
    {v1::ERROR_REASON_ORACLE_BAD_SIZE, grpc::StatusCode::INVALID_ARGUMENT},
    {v1::ERROR_REASON_ORACLE_BAD_CONORMAL, grpc::StatusCode::INVALID_ARGUMENT},
    {v1::ERROR_REASON_ORACLE_NOT_IDEMPOTENT, grpc::StatusCode::INVALID_ARGUMENT},
    {v1::ERROR_REASON_ORACLE_FAILED, grpc::StatusCode::ABORTED},
    {v1::ERROR_REASON_NO_WORKER, grpc::StatusCode::FAILED_PRECONDITION},
};

struct CoreRow {
  core::StatusCode code;
  v1::ErrorReason reason;
};

constexpr CoreRow kReasons[] = {
    {core::StatusCode::kOk, v1::ERROR_REASON_UNSPECIFIED},
    {core::StatusCode::kInvalidArgument, v1::ERROR_REASON_INVALID_ARGUMENT},
    {core::StatusCode::kLimitExceeded, v1::ERROR_REASON_LIMIT_EXCEEDED},
    {core::StatusCode::kNoSeeds, v1::ERROR_REASON_NO_SEEDS},
    {core::StatusCode::kOracleShape, v1::ERROR_REASON_ORACLE_SHAPE},
    {core::StatusCode::kOracleNotFinite, v1::ERROR_REASON_ORACLE_NOT_FINITE},
    {core::StatusCode::kOracleOffFlat, v1::ERROR_REASON_ORACLE_OFF_FLAT},
    {core::StatusCode::kOracleOutsideRadius, v1::ERROR_REASON_ORACLE_OUTSIDE_RADIUS},
    {core::StatusCode::kOracleBadTangent, v1::ERROR_REASON_ORACLE_BAD_TANGENT},
    {core::StatusCode::kOracleBadSize, v1::ERROR_REASON_ORACLE_BAD_SIZE},
    {core::StatusCode::kOracleBadConormal, v1::ERROR_REASON_ORACLE_BAD_CONORMAL},
    {core::StatusCode::kOracleNotIdempotent, v1::ERROR_REASON_ORACLE_NOT_IDEMPOTENT},
    {core::StatusCode::kOracleFailed, v1::ERROR_REASON_ORACLE_FAILED},
    {core::StatusCode::kFailedPrecondition, v1::ERROR_REASON_FAILED_PRECONDITION},
    {core::StatusCode::kCancelled, v1::ERROR_REASON_FAILED_PRECONDITION},
};

std::string ReasonName(v1::ErrorReason reason) {
  return v1::ErrorReason_Name(reason).substr(kReasonPrefix.size());
}

// Any names the standard types, so that every client's usual library reads them.
void Pack(const google::protobuf::Message& message, const char* type, rpc::Status* status) {
  google::protobuf::Any* const any = status->add_details();
  any->set_type_url(std::string("type.googleapis.com/google.rpc.") + type);
  any->set_value(message.SerializeAsString());
}

// What the worker knows the answer by: the query's index, which the message has, is the round's.
std::string PlaceText(const std::optional<AnswerPlace>& answer) {
  if (!answer) return "";
  std::string text = " (lease " + std::to_string(answer->lease);
  if (answer->row) text += ", row " + std::to_string(*answer->row);
  return text + ")";
}

}  // namespace

std::string Cut(const std::string& text, std::size_t limit) {
  if (text.size() <= limit) return text;
  while (limit > 0 && (static_cast<unsigned char>(text[limit]) & 0xc0) == 0x80) --limit;
  return text.substr(0, limit);
}

grpc::StatusCode CodeOf(v1::ErrorReason reason) {
  for (const ReasonRow& row : kCodes) {
    if (row.reason == reason) return row.code;
  }
  return grpc::StatusCode::INTERNAL;  // a reason that ends meshes only
}

v1::ErrorReason ReasonOf(core::StatusCode code) {
  for (const CoreRow& row : kReasons) {
    if (row.code == code) return row.reason;
  }
  return v1::ERROR_REASON_UNSPECIFIED;
}

grpc::Status Refusal(v1::ErrorReason reason, const std::string& message, const std::string& field,
                     const std::optional<LimitHit>& limit,
                     const std::optional<AnswerPlace>& answer) {
  const grpc::StatusCode code = CodeOf(reason);
  rpc::Status details;
  details.set_code(code);
  details.set_message(Cut(message, kMaxMessageBytes));
  rpc::ErrorInfo info;
  info.set_reason(ReasonName(reason));
  info.set_domain("stellate.v1");
  if (limit) {
    (*info.mutable_metadata())["limit"] = limit->setting;
    (*info.mutable_metadata())["value"] = limit->value;
    (*info.mutable_metadata())["scope"] = limit->scope;
  }
  if (answer) {
    (*info.mutable_metadata())["lease"] = std::to_string(answer->lease);
    if (answer->row) (*info.mutable_metadata())["row"] = std::to_string(*answer->row);
  }
  Pack(info, "ErrorInfo", &details);
  if (!field.empty()) {
    rpc::BadRequest bad;
    rpc::BadRequest::FieldViolation* const violation = bad.add_field_violations();
    violation->set_field(field);
    violation->set_description(details.message());
    Pack(bad, "BadRequest", &details);
  }
  if (limit) {
    rpc::QuotaFailure quota;
    rpc::QuotaFailure::Violation* const violation = quota.add_violations();
    violation->set_subject(limit->scope);
    violation->set_description(limit->setting + " is " + limit->value);
    Pack(quota, "QuotaFailure", &details);
  }
  return {code, details.message(), details.SerializeAsString()};
}

grpc::Status ToGrpc(const core::Status& status, const std::string& prefix) {
  return ToGrpc(Refused(status), prefix);
}

grpc::Status ToGrpc(const Refused& status, const std::string& prefix) {
  if (status.ok()) return grpc::Status::OK;
  const bool of_request = status.code == core::StatusCode::kInvalidArgument ||
                          status.code == core::StatusCode::kLimitExceeded;
  const std::string field = of_request || status.answer ? status.field : "";
  return Refusal(ReasonOf(status.code), status.message + PlaceText(status.answer),
                 field.empty() ? "" : prefix + field, status.limit, status.answer);
}

}  // namespace stellate::server
