#pragma once

#include <grpcpp/support/status.h>

#include <optional>
#include <string>

#include "core/status.h"
#include "server/base/refusal.h"
#include "stellate/v1/errors.pb.h"

namespace stellate::server {

// Converts refusals to gRPC statuses, here alone. Each status has a google.rpc.ErrorInfo (domain
// "stellate.v1", the reason's name without prefix); a google.rpc.BadRequest if a field of the
// request is wrong; and a google.rpc.QuotaFailure if a limit was reached. ErrorInfo.metadata has
// the limit, and the lease and the row of an answer that broke a rule. Messages are cut to fit into
// a reply's trailers.
grpc::Status Refusal(v1::ErrorReason reason, const std::string& message,
                     const std::string& field = "",
                     const std::optional<LimitHit>& limit = std::nullopt,
                     const std::optional<AnswerPlace>& answer = std::nullopt);

// The status code of a reason, as errors.proto states it.
grpc::StatusCode CodeOf(v1::ErrorReason reason);

v1::ErrorReason ReasonOf(core::StatusCode code);  // UNSPECIFIED for kOk alone

// OK for Ok. `prefix` is put before the name of the field, if there is one.
grpc::Status ToGrpc(const core::Status& status, const std::string& prefix = "");
grpc::Status ToGrpc(const Refused& refused, const std::string& prefix = "");

constexpr std::size_t kMaxFailureBytes = 4096;  // of the message of a failed mesh or oracle

// At most `limit` bytes of `text`, never cutting a UTF-8 character.
std::string Cut(const std::string& text, std::size_t limit);

}  // namespace stellate::server
