#include "doctor_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <iostream>
#include <memory>
#include <utility>

#include "doctor_server.h"
#include "server_options.h"
#include "text/printable.h"

namespace stellate::cli {

DoctorCommand::DoctorCommand(CLI::App& parent)
    : command_(parent.add_subcommand(
          "doctor", "Test whether an oracle keeps its contract, and say in words what is wrong")),
      source_(command_) {
  command_->add_option("-e,--epsilon", options_.epsilon, "that a mesh is planned with");
  command_->add_option("--seed", options_.random_seed, "of the random queries")
      ->capture_default_str();
  command_->add_flag("--json", json_, "print the report as JSON, as doctor.proto has it");
  CLI::Option* const listen = command_->add_option(
      "--listen", listen_,
      "examine the oracles of workers that come here as to a server: host:port or unix:/path");
  command_
      ->add_option("--tls-cert", tls_certificate_,
                   "PEM file with its certificate: other machines may come, over TLS")
      ->needs(listen);
  command_->add_option("--tls-key", tls_key_, "PEM file with its key")->needs(listen);
  command_
      ->add_option("--tls-client-ca", tls_client_ca_,
                   "PEM file: workers show certificates of these authorities")
      ->needs(listen);
  command_->add_flag("--exit-with-parent", exit_with_parent_, "stop when the parent process ends")
      ->needs(listen);
  command_->footer(
      "An oracle of your own: --oracle-command, python3 -m stellate doctor MODULE:OBJECT, "
      "stellate::Check in C++, and in other languages what their client calls check.\n"
      "Exit status: 0 it keeps its contract, 1 it does not, 2 usage, 3 the command does not run.");
}

int DoctorCommand::Run(const std::stop_token& stop) {
  if (!listen_.empty()) return Listen(stop);
  const Expected<std::unique_ptr<Oracle>> oracle = source_.Make(stop);
  if (!oracle) return PrintError(oracle.error());
  const CheckReport report = Check(**oracle, options_);
  if (stop.stop_requested()) {
    std::cerr << "stellate: stopped before the end of the examination\n";
    return kExitNotCertified;
  }
  Print(report);
  return report.ok() ? kExitCertified : kExitNotCertified;
}

// Until it is stopped. The exit status is that of the worst oracle.
int DoctorCommand::Listen(const std::stop_token& stop) {
  const pid_t parent = getppid();
  std::signal(SIGPIPE, SIG_IGN);  // whoever started it need not read the reports
  std::atomic<bool> all_well = true;
  DoctorOptions options;
  options.listen = listen_;
  options.tls_certificate = tls_certificate_;
  options.tls_key = tls_key_;
  options.tls_client_ca = tls_client_ca_;
  options.random_seed = options_.random_seed;
  options.on_listening = [](const std::string& address) {
    std::cout << "stellate doctor listening on " << address << std::endl;
  };
  options.on_report = [&](const CheckReport& report) {
    if (!report.ok()) all_well = false;
    Print(report);
  };
  options.goes_on = [&] {
    return !stop.stop_requested() && !(exit_with_parent_ && getppid() != parent);
  };
  if (const auto done = RunDoctor(options); !done) return PrintError(done.error());
  return all_well ? kExitCertified : kExitNotCertified;
}

void DoctorCommand::Print(const CheckReport& report) const {
  if (json_) {
    std::cout << ToJson(report) << std::flush;
    return;
  }
  CheckReport shown = report;  // in the words of oracles that may be others'
  for (Finding& finding : shown.findings) finding.message = text::Printable(finding.message, '?');
  std::cout << ToText(shown) << std::flush;
}

}  // namespace stellate::cli
