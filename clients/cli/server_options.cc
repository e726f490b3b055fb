#include "server_options.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>

#include "text/printable.h"

namespace stellate::cli {
namespace {

std::string FromEnvironment(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

}  // namespace

ServerOptions::ServerOptions(CLI::App* command, const std::string& default_address) {
  connection_.server = default_address;
  CLI::Option* const server = command->add_option(
      "--server", connection_.server,
      default_address.empty() ? "host:port or unix:/path; default: a private one is started"
                              : "host:port or unix:/path");
  if (!default_address.empty()) server->capture_default_str();
  Credentials& credentials = connection_.credentials;
  CLI::Option_group* const safety = command->add_option_group("Safety");
  safety->add_flag("--tls", credentials.tls, "TLS, trusting the system's authorities");
  safety->add_option("--tls-ca", credentials.tls_ca, "PEM file: TLS, trusting these instead");
  safety->add_option("--tls-cert", credentials.tls_certificate,
                     "PEM file with a client certificate, where the server asks for one");
  safety->add_option("--tls-key", credentials.tls_key, "PEM file with its key");
  safety->add_option("--token-file", token_file_,
                     "file that holds the token alone; default: $STELLATE_TOKEN, if set");
}

void ServerOptions::AddReconnect(CLI::App* command) {
  command
      ->add_option_function<double>(
          "--reconnect", [this](double seconds) { connection_.reconnect = Seconds(seconds); },
          "seconds to wait for a server that went away")
      ->default_str(CLI::detail::to_string(connection_.reconnect.count()));
}

Expected<Connection> ServerOptions::Read() const {
  Connection connection = connection_;
  // As OpenTelemetry has programs hand a trace on to those that they start.
  connection.trace = {FromEnvironment("TRACEPARENT"), FromEnvironment("TRACESTATE")};
  if (connection.server.empty()) return connection;
  std::string& token = connection.credentials.token;
  if (token_file_.empty()) {
    token = FromEnvironment("STELLATE_TOKEN");
    return connection;
  }
  std::ifstream file(token_file_);
  std::string rest;
  if (!(file >> token) || file >> rest) {
    return Fail(ErrorCode::kRefused, token_file_ + " must hold one token and nothing else");
  }
  return connection;
}

void PrintOutage(const Outage& outage, Seconds patience) {
  if (outage.over) {
    std::fprintf(stderr, "stellate: the server is back after %.1f s\n", outage.lasted.count());
  } else if (outage.attempts == 1) {
    std::fprintf(stderr, "stellate: lost the server (%s): trying again for up to %.0f s\n",
                 text::Printable(outage.message, '?').c_str(), patience.count());
  }
}

int PrintError(const Error& error) {
  const std::string words = (error.reason.empty() ? "" : error.reason + ": ") + error.message;
  std::cerr << "stellate: " << text::PrintableLines(words, '?') << "\n";
  return ExitStatusOf(error);
}

void PrintText(const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    std::cout << text::Printable(line, '?') << "\n";
}

}  // namespace stellate::cli
