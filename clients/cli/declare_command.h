#pragma once

#include <CLI/App.hpp>
#include <stop_token>
#include <string>

#include "oracle_source.h"
#include "server_options.h"
#include "spec_options.h"

namespace stellate::cli {

// `stellate declare`: a mesh for others to serve.
class DeclareCommand {
 public:
  explicit DeclareCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run(std::stop_token stop);

 private:
  CLI::App* command_;
  OracleSource source_;
  ServerOptions server_;
  SpecOptions spec_;
  std::string label_;
};

}  // namespace stellate::cli
