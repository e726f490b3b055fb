#pragma once

#include <CLI/App.hpp>
#include <stop_token>
#include <string>

#include "oracle_source.h"
#include "outputs.h"
#include "report_output.h"
#include "server_options.h"
#include "spec_options.h"
#include "stellate/client.h"

namespace stellate::cli {

// `stellate mesh`.
class MeshCommand {
 public:
  explicit MeshCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run(std::stop_token stop);

 private:
  Expected<SavedMesh> MeshIt(Oracle& oracle);

  CLI::App* command_;
  OracleSource source_;
  ServerOptions server_;
  SpecOptions spec_;
  MeshOptions& options_ = spec_.options;
  Outputs outputs_;
  ReportOutput report_;
  bool closest_point_only_ = false;
};

}  // namespace stellate::cli
