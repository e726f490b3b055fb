#pragma once

#include <CLI/App.hpp>
#include <stop_token>

#include "oracle_source.h"
#include "stellate/doctor.h"

namespace stellate::cli {

// `stellate doctor`: the catalogue's oracles, and commands, under examination.
class DoctorCommand {
 public:
  explicit DoctorCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run(const std::stop_token& stop);

 private:
  CLI::App* command_;
  OracleSource source_;
  CheckOptions options_;
};

}  // namespace stellate::cli
