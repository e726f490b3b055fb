#pragma once

#include <CLI/App.hpp>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "stellate/client.h"

namespace stellate::cli {

// Exit statuses of every command.
inline constexpr int kExitCertified = 0;  // or simply: done
inline constexpr int kExitNotCertified = 1;
inline constexpr int kExitRefused = 2;  // usage, a refused request, a file that cannot be written
inline constexpr int kExitFailed = 3;   // the server or the oracle

// `stellate mesh`.
class MeshCommand {
 public:
  explicit MeshCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  int Run(std::stop_token stop);

 private:
  void AddCriteria();

  CLI::App* command_;
  MeshOptions options_;
  std::string manifold_, token_file_;
  std::vector<std::string> outputs_;
  bool json_ = false, quiet_ = false, closest_point_only_ = false;
};

// The options that say how to reach a server; --token-file is read by Authorize.
void AddCredentials(CLI::App* command, Credentials* credentials, std::string* token_file);
// Reads the token from the file or from $STELLATE_TOKEN, neither of which `ps` shows.
Expected<void> Authorize(const std::string& token_file, Credentials* credentials);

// Prints the error on standard error and gives the exit status that stands for it.
int Complain(const Error& error);

}  // namespace stellate::cli
