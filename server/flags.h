#pragma once

#include <optional>

#include "server/config.h"

namespace stellate::server {

struct Flags {
  Config config;
  bool health_check = false;
  bool exit_with_parent = false;
};

// Reads the command line. When there is nothing more to do (--help, --version, a mistake), prints
// what there is to say and returns the exit status instead.
struct ParsedFlags {
  Flags flags;
  std::optional<int> exit_status;
};
ParsedFlags ParseFlags(int argc, char** argv);

}  // namespace stellate::server
