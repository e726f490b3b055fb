#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/config/config.h"

namespace stellate::server {

struct Flags {
  Config config;
  std::string config_file;  // that --config names; empty: none
  bool health_check = false;
  std::string health_certificate, health_key;  // shown by it; empty: the server's own
  std::string health_service;  // whose health --health-check asks for; empty: the whole server's
  bool exit_with_parent = false;
  bool verify_data_dir = false, salvage = false;  // instead of serving
  std::vector<std::string> copy_meshes;           // the same: from where, and to where; else empty
};

// Reads the command line and the configuration file that it names; the command line takes
// precedence. After --help, --version, --print-config or a mistake, prints the output and returns
// the exit status instead.
struct ParsedFlags {
  Flags flags;
  std::optional<int> exit_status;
};
ParsedFlags ParseFlags(int argc, const char* const* argv);

// The settings that the same command line makes now, as its configuration file may have changed.
// kInvalidArgument: what is wrong with that.
core::Expected<Config> ReadSettingsAgain(int argc, const char* const* argv);

}  // namespace stellate::server
