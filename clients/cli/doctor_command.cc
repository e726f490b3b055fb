#include "doctor_command.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <utility>

#include "server_options.h"

namespace stellate::cli {

DoctorCommand::DoctorCommand(CLI::App& parent)
    : command_(parent.add_subcommand(
          "doctor", "Probe an oracle for its contract, and say in words what is wrong")),
      source_(command_) {
  command_->add_option("-e,--epsilon", options_.epsilon, "that a mesh is planned with");
  command_->add_option("--seed", options_.random_seed, "of the random questions")
      ->capture_default_str();
  command_->footer(
      "An oracle of your own: --oracle-command, python3 -m stellate doctor MODULE:OBJECT, or "
      "stellate::Check in C++.\nExit status: 0 it keeps its contract, 1 it does not, 2 usage, 3 "
      "the command "
      "does not run.");
}

int DoctorCommand::Run(const std::stop_token& stop) {
  const Expected<std::unique_ptr<Oracle>> oracle = source_.Make(stop);
  if (!oracle) return PrintError(oracle.error());
  const CheckReport report = Check(**oracle, options_);
  if (stop.stop_requested()) {
    std::cerr << "stellate: stopped before the end of the examination\n";
    return kExitNotCertified;
  }
  std::cout << ToText(report);
  return report.ok() ? kExitCertified : kExitNotCertified;
}

}  // namespace stellate::cli
