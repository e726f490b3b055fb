#pragma once

#include <CLI/App.hpp>
#include <stop_token>
#include <string>
#include <vector>

#include "outputs.h"
#include "report_output.h"
#include "server_options.h"
#include "stellate/reconstruct.h"

namespace stellate::cli {

// `stellate reconstruct`.
class ReconstructCommand {
 public:
  explicit ReconstructCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run(std::stop_token stop);

 private:
  CLI::App* command_;
  ServerOptions server_;
  ReconstructOptions options_;
  std::string points_;
  std::optional<int> coordinates_;
  std::vector<std::string> columns_;
  Outputs outputs_;
  ReportOutput report_;
  bool open_ = false;
};

}  // namespace stellate::cli
