#pragma once

#include <CLI/App.hpp>
#include <stop_token>

#include "oracle_source.h"
#include "server_options.h"
#include "stellate/doctor.h"

namespace stellate::cli {

// `stellate doctor`: an oracle under examination, the catalogue's, a solid or a command.
class DoctorCommand {
 public:
  explicit DoctorCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run(const std::stop_token& stop);

 private:
  CLI::App* command_;
  OracleSource source_;
  ServerOptions server_;
  CheckOptions options_;
  bool json_ = false;
};

}  // namespace stellate::cli
