#pragma once

#include <CLI/App.hpp>
#include <string>

#include "stellate/doctor.h"

namespace stellate::cli {

// `stellate doctor`: the catalogue's oracles under examination.
class DoctorCommand {
 public:
  explicit DoctorCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run() const;

 private:
  CLI::App* command_;
  CheckOptions options_;
  std::string manifold_;
};

}  // namespace stellate::cli
