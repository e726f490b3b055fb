#pragma once

#include <string>

#include "core/specification.h"
#include "server/oracles/dispatch.h"

namespace stellate::server {

// A mesh as it was asked for: all of it that a journal keeps.
struct MeshRequest {
  std::string name;   // "meshes/<id>"
  std::string owner;  // whose it is; empty where the server tells nobody apart
  std::string label;  // the client's
  core::Specification spec;
  OracleTimeouts timeouts;
};

}  // namespace stellate::server
