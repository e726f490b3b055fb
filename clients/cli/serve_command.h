#pragma once

#include <CLI/App.hpp>
#include <stop_token>
#include <string>

#include "oracle_source.h"
#include "server_options.h"
#include "stellate/serve.h"

namespace stellate::cli {

// `stellate serve`: workers for a mesh that somebody else declared.
class ServeCommand {
 public:
  explicit ServeCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run(std::stop_token stop);

 private:
  Expected<MeshState> Serve(Oracle& oracle);

  CLI::App* command_;
  std::string mesh_;
  CLI::Option* name_;  // the first of the arguments
  OracleSource source_;
  ServerOptions server_;
  ServeOptions options_;
};

}  // namespace stellate::cli
