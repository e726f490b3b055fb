#pragma once

#include <CLI/App.hpp>
#include <stop_token>
#include <string>

#include "server_options.h"
#include "top_table.h"

namespace stellate::cli {

// `stellate top`: a server's meshes, live.
class TopCommand {
 public:
  explicit TopCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run(const std::stop_token& stop) const;

 private:
  CLI::App* command_;
  ServerOptions server_;
  TopOrder order_ = TopOrder::kState;
  double interval_ = 1;
  bool once_ = false;
};

}  // namespace stellate::cli
