#pragma once

#include <grpcpp/support/status.h>

#include <optional>
#include <string>

#include "core/status.h"
#include "server/base/refusal.h"
#include "stellate/v1/errors.pb.h"

namespace stellate::server {

// The one place where refusals become gRPC statuses. Each carries google.rpc.ErrorInfo (domain
// "stellate.v1", the reason's name without prefix), where a field of the request is to blame
// google.rpc.BadRequest, and where a limit was reached google.rpc.QuotaFailure, the limit standing
// in ErrorInfo.metadata too, as do the lease and the row of an answer that broke a rule. Messages
// are cut so that they fit into a reply's trailers.
grpc::Status Refusal(v1::ErrorReason reason, const std::string& message,
                     const std::string& field = "",
                     const std::optional<LimitHit>& limit = std::nullopt,
                     const std::optional<AnswerPlace>& answer = std::nullopt);

// The code that a reason travels with, as errors.proto states it.
grpc::StatusCode CodeOf(v1::ErrorReason reason);

v1::ErrorReason ReasonOf(core::StatusCode code);  // UNSPECIFIED for kOk alone

// OK for Ok. `prefix` goes before the field of the request that is to blame, if one is.
grpc::Status ToGrpc(const core::Status& status, const std::string& prefix = "");
grpc::Status ToGrpc(const Refused& refused, const std::string& prefix = "");

constexpr std::size_t kMaxFailureBytes = 4096;  // of the words in which a mesh or an oracle failed

// At most `limit` bytes of `text`, never cutting a UTF-8 character.
std::string Cut(const std::string& text, std::size_t limit);

}  // namespace stellate::server
