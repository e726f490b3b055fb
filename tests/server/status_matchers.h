#pragma once

#include <grpcpp/support/status.h>

#include <string>

#include "server/status_details.pb.h"

namespace stellate::server::testing {

inline Status DetailsOf(const grpc::Status& status) {
  Status details;
  details.ParseFromString(status.error_details());
  return details;
}

// The ErrorInfo's reason in a status's details, "" if there is none.
inline std::string ReasonIn(const grpc::Status& status) {
  const Status details = DetailsOf(status);
  for (const auto& any : details.details()) {
    ErrorInfo info;
    if (any.type_url() == "type.googleapis.com/google.rpc.ErrorInfo" &&
        info.ParseFromString(any.value()) && info.domain() == "stellate.v1") {
      return info.reason();
    }
  }
  return "";
}

// The BadRequest's field in a status's details, "" if there is none.
inline std::string FieldIn(const grpc::Status& status) {
  const Status details = DetailsOf(status);
  for (const auto& any : details.details()) {
    BadRequest bad;
    if (any.type_url() == "type.googleapis.com/google.rpc.BadRequest" &&
        bad.ParseFromString(any.value()) && bad.field_violations_size() == 1) {
      return bad.field_violations(0).field();
    }
  }
  return "";
}

}  // namespace stellate::server::testing
