#pragma once

#include <CLI/App.hpp>
#include <stop_token>
#include <string>

#include "oracle_source.h"
#include "stellate/doctor.h"

namespace stellate::cli {

// `stellate doctor`: oracles under examination, the catalogue's, commands, and those of workers in
// any language, which come as to a server.
class DoctorCommand {
 public:
  explicit DoctorCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run(const std::stop_token& stop);

 private:
  int Listen(const std::stop_token& stop);
  void Print(const CheckReport& report) const;

  CLI::App* command_;
  OracleSource source_;
  CheckOptions options_;
  std::string listen_, tls_certificate_, tls_key_, tls_client_ca_;
  bool exit_with_parent_ = false, json_ = false;
};

}  // namespace stellate::cli
