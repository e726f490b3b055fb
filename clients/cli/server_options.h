#pragma once

#include <CLI/App.hpp>
#include <string>

#include "exit_status.h"
#include "stellate/connection.h"
#include "stellate/error.h"

namespace stellate::cli {

// The options that say how to reach a server.
class ServerOptions {
 public:
  // An empty default stands for a private server.
  ServerOptions(CLI::App* command, const std::string& default_address);

  // Adds --reconnect, for a command that waits for a server that went away.
  void AddReconnect(CLI::App* command);

  const std::string& address() const { return connection_.server; }
  // The token comes from its file or from $STELLATE_TOKEN, so that `ps` does not show it; not read
  // for a private server.
  Expected<Connection> Read() const;

 private:
  Connection connection_;
  std::string token_file_;
};

// Says on standard error that the server was lost, or is back. `patience`: how long the command
// waits for it.
void PrintOutage(const Outage& outage, Seconds patience);

// What servers and the oracles of others say is made text::Printable by both that follow.

// Prints the error on standard error and gives the exit status that stands for it.
int PrintError(const Error& error);
// Prints several lines on standard output.
void PrintText(const std::string& text);

}  // namespace stellate::cli
