#pragma once

#include <string>

#include "core/status.h"

namespace stellate::server {

// Where spans go.
struct CollectorUrl {
  std::string target;  // as gRPC dials it
  bool tls = false;
  bool is_local = false;  // on this machine
};

// "http://HOST:PORT" or "https://HOST:PORT"; the port is 4317 where none is said, and a "/" may
// follow. `name` is what a refusal names.
core::Expected<CollectorUrl> ParseCollectorUrl(const std::string& text,
                                               const std::string& name = "--traces-to");

}  // namespace stellate::server
