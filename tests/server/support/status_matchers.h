#pragma once

#include <grpcpp/support/status.h>

#include <string>

#include "stellate/rpc/status_details.pb.h"

namespace stellate::server::testing {

inline rpc::Status DetailsOf(const grpc::Status& status) {
  rpc::Status details;
  details.ParseFromString(status.error_details());
  return details;
}

// The ErrorInfo's reason in a status's details, "" if there is none.
inline std::string ReasonIn(const grpc::Status& status) {
  const rpc::Status details = DetailsOf(status);
  for (const auto& any : details.details()) {
    rpc::ErrorInfo info;
    if (any.type_url() == "type.googleapis.com/google.rpc.ErrorInfo" &&
        info.ParseFromString(any.value()) && info.domain() == "stellate.v1") {
      return info.reason();
    }
  }
  return "";
}

// A value of the ErrorInfo's metadata, "" if there is none.
inline std::string MetadataIn(const grpc::Status& status, const std::string& key) {
  const rpc::Status details = DetailsOf(status);
  for (const auto& any : details.details()) {
    rpc::ErrorInfo info;
    if (any.type_url() == "type.googleapis.com/google.rpc.ErrorInfo" &&
        info.ParseFromString(any.value()) && info.metadata().contains(key)) {
      return info.metadata().at(key);
    }
  }
  return "";
}

// "max-meshes=3 of server": the limit that a status's details name, "" if there is none. The
// QuotaFailure must say the same.
inline std::string LimitIn(const grpc::Status& status) {
  const rpc::Status details = DetailsOf(status);
  std::string limit, quota_words;
  for (const auto& any : details.details()) {
    rpc::ErrorInfo info;
    rpc::QuotaFailure quota;
    if (any.type_url() == "type.googleapis.com/google.rpc.ErrorInfo" &&
        info.ParseFromString(any.value()) && info.metadata().contains("limit")) {
      limit = info.metadata().at("limit") + "=" + info.metadata().at("value") + " of " +
              info.metadata().at("scope");
    }
    if (any.type_url() == "type.googleapis.com/google.rpc.QuotaFailure" &&
        quota.ParseFromString(any.value()) && quota.violations_size() == 1) {
      std::string words = quota.violations(0).description();
      const std::size_t is = words.find(" is ");
      if (is != std::string::npos) words.replace(is, 4, "=");
      quota_words = words + " of " + quota.violations(0).subject();
    }
  }
  return limit == quota_words ? limit : "ErrorInfo and QuotaFailure differ: " + quota_words;
}

// The BadRequest's field in a status's details, "" if there is none.
inline std::string FieldIn(const grpc::Status& status) {
  const rpc::Status details = DetailsOf(status);
  for (const auto& any : details.details()) {
    rpc::BadRequest bad;
    if (any.type_url() == "type.googleapis.com/google.rpc.BadRequest" &&
        bad.ParseFromString(any.value()) && bad.field_violations_size() == 1) {
      return bad.field_violations(0).field();
    }
  }
  return "";
}

}  // namespace stellate::server::testing
