#pragma once

#include <CLI/App.hpp>
#include <stop_token>
#include <string>

#include "outputs.h"
#include "report_output.h"
#include "server_options.h"
#include "stellate/download.h"

namespace stellate::cli {

// `stellate download`.
class DownloadCommand {
 public:
  explicit DownloadCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run(std::stop_token stop);

 private:
  int Deliver(const SavedMesh& mesh) const;

  CLI::App* command_;
  ServerOptions server_;
  DownloadOptions options_;
  std::string mesh_;
  Outputs outputs_;
  ReportOutput report_;
  bool wait_ = false, unfinished_ = false;
};

}  // namespace stellate::cli
