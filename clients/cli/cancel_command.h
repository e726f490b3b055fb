#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

#include "server_options.h"

namespace stellate::cli {

// `stellate cancel`: ends meshes of a server: the token's own, or those of all owners if it is an
// administrator's.
class CancelCommand {
 public:
  explicit CancelCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run() const;

 private:
  CLI::App* command_;
  ServerOptions server_;
  std::vector<std::string> meshes_;
  bool forget_ = false;
};

}  // namespace stellate::cli
