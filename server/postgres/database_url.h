#pragma once

#include <string>

#include "core/status.h"

namespace stellate::server {

// What --database names, a URL of PostgreSQL or a file that holds one, as libpq takes it.
// kInvalidArgument, with what to do: it makes no sense, shows a password to all who list the
// machine's processes, or would send one over a network that others listen to.
core::Expected<std::string> ReadDatabaseUrl(const std::string& setting);

}  // namespace stellate::server
