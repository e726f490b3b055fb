#pragma once

#include <string>

#include "core/status.h"

namespace stellate::server {

// Removes a socket that an ended server left at `path`. gRPC would replace any socket, even that of
// a running server. kFailedPrecondition: a server listens there, it is no socket, or its directory
// takes none.
core::Status ClearUnixPath(const std::string& path);

}  // namespace stellate::server
