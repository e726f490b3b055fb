#pragma once

#include <grpcpp/support/status.h>

#include <string>

#include "stellate/error.h"
#include "stellate/v1/mesh.pb.h"

namespace stellate::client {

// The error that a failed call stands for.
Error FromStatus(const grpc::Status& status);

// Of a mesh that failed.
Error WhyFailed(const v1::Mesh& mesh);

// What a server sent that makes no sense.
Error BrokenProtocol(const std::string& what);

}  // namespace stellate::client
