#pragma once

#include <string>

#include "server/metrics/counts.h"

namespace stellate::server {

// An HTML page about the server, for a person who opens its address in a browser. It has no name of
// a mesh, a worker or an owner.
std::string FrontPage(const Counts& counts, const std::string& why_not);

}  // namespace stellate::server
