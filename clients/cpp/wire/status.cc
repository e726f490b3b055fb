#include "wire/status.h"

#include <iterator>
#include <string_view>
#include <utility>

#include "shared/errors.h"
#include "stellate/rpc/status_details.pb.h"

namespace stellate::client {
namespace {

// What a table of errors.toml says of a key; empty if it is silent.
template <size_t N>
std::string_view LookUp(const shared::Entry (&table)[N], std::string_view key) {
  for (const shared::Entry& entry : table) {
    if (key == entry.key) return entry.value;
  }
  return "";
}

ErrorCode CodeOf(std::string_view error_class) {
  const std::string_view fault = LookUp(shared::kClasses, error_class);
  if (fault == "request") return ErrorCode::kRefused;
  if (fault == "oracle") return ErrorCode::kOracleFailed;
  return fault == "file" ? ErrorCode::kFileFailed : ErrorCode::kServerFailed;
}

// Whose fault an error is: its reason says, or the name of the status's code.
ErrorCode Judge(const std::string& reason, std::string_view code) {
  std::string_view error_class = LookUp(shared::kReasons, reason);
  if (error_class.empty() && reason.rfind("ORACLE_", 0) == 0) error_class = "OracleError";
  if (error_class.empty()) error_class = LookUp(shared::kCodes, code);
  return CodeOf(error_class);
}

std::string_view NameOf(grpc::StatusCode code) {
  constexpr std::string_view kNames[] = {"OK",
                                         "CANCELLED",
                                         "UNKNOWN",
                                         "INVALID_ARGUMENT",
                                         "DEADLINE_EXCEEDED",
                                         "NOT_FOUND",
                                         "ALREADY_EXISTS",
                                         "PERMISSION_DENIED",
                                         "RESOURCE_EXHAUSTED",
                                         "FAILED_PRECONDITION",
                                         "ABORTED",
                                         "OUT_OF_RANGE",
                                         "UNIMPLEMENTED",
                                         "INTERNAL",
                                         "UNAVAILABLE",
                                         "DATA_LOSS",
                                         "UNAUTHENTICATED"};
  const auto i = static_cast<size_t>(code);
  return i < std::size(kNames) ? kNames[i] : "UNKNOWN";
}

// The name of a status's ErrorInfo, if it carries one.
std::string ReasonOf(const grpc::Status& status) {
  rpc::Status details;
  if (!details.ParseFromString(status.error_details())) return "";
  for (const google::protobuf::Any& any : details.details()) {
    rpc::ErrorInfo info;
    if (any.type_url() == "type.googleapis.com/google.rpc.ErrorInfo" &&
        info.ParseFromString(any.value()) && info.domain() == "stellate.v1") {
      return info.reason();
    }
  }
  return "";
}

// What is likely to help where the two sides do not agree how to connect; gRPC's own words and
// those of its TLS library are all there is to go by.
std::string_view Advice(const grpc::Status& status) {
  const auto says = [&status](std::string_view words) {
    return status.error_message().find(words) != std::string::npos;
  };
  if (status.error_code() == grpc::StatusCode::UNAUTHENTICATED) {
    return "give a token with --token-file FILE or $STELLATE_TOKEN (in C++ Credentials::token)";
  }
  if (status.error_code() != grpc::StatusCode::UNAVAILABLE) return "";
  if (says("wrong version number")) {
    return "the server speaks plain text: leave --tls, --tls-ca and --tls-cert away (in C++ "
           "Credentials::tls, tls_ca, tls_certificate)";
  }
  if (says("certificate verify failed")) {
    return "the server's certificate is of no authority that is trusted here: --tls-ca FILE names "
           "one (in C++ Credentials::tls_ca)";
  }
  if (says("empty address list")) {  // as gRPC puts it that it has no roots
    return "with TLS: no authority of certificates can be read on this machine; install "
           "ca-certificates, or --tls-ca FILE names one (in C++ Credentials::tls_ca)";
  }
  if (says("failed to connect") && (says("Socket closed") || says("Connection reset"))) {
    return "does the server want TLS? --tls or --tls-ca FILE. Or a client certificate? --tls-cert "
           "and --tls-key (in C++ Credentials)";
  }
  if (says("failed to connect") && says("Connection refused")) {
    return "no server listens there: start a server with `stellated`, or name another with "
           "--server";
  }
  return "";
}

}  // namespace

Error FromStatus(const grpc::Status& status) {
  std::string reason = ReasonOf(status);
  std::string message = status.error_message();
  if (const std::string_view advice = Advice(status); !advice.empty()) {
    message += "; ";
    message += advice;
  }
  const ErrorCode code = Judge(reason, NameOf(status.error_code()));
  return {code, std::move(reason), std::move(message)};
}

Error WhyFailed(const v1::Mesh& mesh) {
  const v1::Failure& failure = mesh.report().failure();
  return {Judge(failure.reason(), ""), failure.reason(), failure.message()};
}

Error BrokenProtocol(const std::string& what) {
  return {ErrorCode::kServerFailed, "PROTOCOL", "the server sent " + what};
}

}  // namespace stellate::client
