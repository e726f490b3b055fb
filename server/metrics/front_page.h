#pragma once

#include <string>

#include "server/metrics/counts.h"

namespace stellate::server {

// What the server is and does, for whoever opens its address in a browser: HTML, without a name of
// a mesh, a worker or an owner.
std::string FrontPage(const Counts& counts, bool is_serving);

}  // namespace stellate::server
