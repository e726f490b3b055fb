#pragma once

#include <CLI/App.hpp>
#include <cstdint>
#include <stop_token>
#include <string>

#include "server_options.h"

namespace stellate::cli {

// `stellate view`: meshes in a browser, as they grow and when they are done.
class ViewCommand {
 public:
  explicit ViewCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run(std::stop_token stop) const;

 private:
  int WriteHtml(std::stop_token stop) const;
  int ShowLive(const std::stop_token& stop) const;
  int ShowDemo(const std::stop_token& stop) const;
  Expected<void> Serve(const Connection& connection, const std::stop_token& stop) const;

  CLI::App* command_;
  ServerOptions server_;
  std::string mesh_, html_;
  std::uint16_t port_ = 0;
  bool demo_ = false, no_browser_ = false, template_ = false;
};

}  // namespace stellate::cli
