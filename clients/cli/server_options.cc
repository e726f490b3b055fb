#include "server_options.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>

#include "text/printable.h"

namespace stellate::cli {

ServerOptions::ServerOptions(CLI::App* command, const std::string& default_address)
    : address_(default_address) {
  CLI::Option* const server = command->add_option(
      "--server", address_,
      default_address.empty() ? "host:port or unix:/path; default: a private one is started"
                              : "host:port or unix:/path");
  if (!default_address.empty()) server->capture_default_str();
  CLI::Option_group* const safety = command->add_option_group("Safety");
  safety->add_flag("--tls", credentials_.tls, "TLS, trusting the system's authorities");
  safety->add_option("--tls-ca", credentials_.tls_ca, "PEM file: TLS, trusting these instead");
  safety->add_option("--tls-cert", credentials_.tls_certificate,
                     "PEM file with a client certificate, where the server asks for one");
  safety->add_option("--tls-key", credentials_.tls_key, "PEM file with its key");
  safety->add_option("--token-file", token_file_,
                     "file that holds the token alone; default: $STELLATE_TOKEN, if set");
}

Expected<Credentials> ServerOptions::ReadCredentials() const {
  Credentials credentials = credentials_;
  if (token_file_.empty()) {
    const char* const token = std::getenv("STELLATE_TOKEN");
    if (token != nullptr) credentials.token = token;
    return credentials;
  }
  std::ifstream file(token_file_);
  std::string rest;
  if (!(file >> credentials.token) || file >> rest) {
    return Fail(ErrorCode::kRefused, token_file_ + " must hold one token and nothing else");
  }
  return credentials;
}

void PrintOutage(const Outage& outage, double patience) {
  if (outage.over) {
    std::fprintf(stderr, "stellate: the server is back after %.1f s\n", outage.seconds);
  } else if (outage.attempts == 1) {
    std::fprintf(stderr, "stellate: lost the server (%s): trying again for up to %.0f s\n",
                 text::Printable(outage.message, '?').c_str(), patience);
  }
}

int PrintError(const Error& error) {
  const std::string words = (error.reason.empty() ? "" : error.reason + ": ") + error.message;
  std::cerr << "stellate: " << text::PrintableLines(words, '?') << "\n";
  return ExitStatusOf(error);
}

void PrintReport(const Report& report) {
  std::istringstream lines(report.text);
  for (std::string line; std::getline(lines, line);)
    std::cout << text::Printable(line, '?') << "\n";
}

}  // namespace stellate::cli
