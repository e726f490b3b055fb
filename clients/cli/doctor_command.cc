#include "doctor_command.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

namespace stellate::cli {

DoctorCommand::DoctorCommand(CLI::App& parent)
    : command_(parent.add_subcommand(
          "doctor", "Test whether an oracle keeps its contract, and say in words what is wrong")),
      source_(command_),
      server_(command_, "") {
  command_->add_option("-e,--epsilon", options_.epsilon, "that a mesh is planned with");
  command_->add_option("--seed", options_.random_seed, "of the random queries")
      ->capture_default_str();
  command_->add_flag("--json", json_, "print the report as JSON, as doctor.proto has it");
  command_->footer(
      "An oracle of your own: --oracle-command, python3 -m stellate doctor MODULE:OBJECT, "
      "stellate::Check in C++, and in other languages what their client calls check.\n"
      "Exit status: 0 it keeps its contract, 1 it does not, 2 usage, 3 the command or the server "
      "does not run.");
}

int DoctorCommand::Run(const std::stop_token& stop) {
  const Expected<Connection> connection = server_.Read();
  if (!connection) return PrintError(connection.error());
  const Expected<std::unique_ptr<Oracle>> oracle = source_.Make(stop);
  if (!oracle) return PrintError(oracle.error());
  options_.connection = *connection;
  options_.stop = stop;
  const Expected<CheckReport> report = Check(**oracle, options_);
  if (stop.stop_requested()) {
    std::cerr << "stellate: stopped before the end of the examination\n";
    return kExitNotCertified;
  }
  if (!report) return PrintError(report.error());
  if (json_) {
    std::cout << ToJson(*report) << std::flush;
  } else {
    PrintText(ToText(*report));
  }
  return report->ok() ? kExitCertified : kExitNotCertified;
}

}  // namespace stellate::cli
