#pragma once

#include <string>

#include "core/status.h"

namespace stellate::server {

// Removes the socket that a server which has ended left at `path`, as gRPC would take over any, a
// living server's too. kFailedPrecondition: a server listens there, or it is no socket.
core::Status ClearUnixPath(const std::string& path);

}  // namespace stellate::server
