#include "doctor_command.h"

#include <CLI/CLI.hpp>
#include <iostream>

#include "server_options.h"
#include "stellate/catalogue.h"

namespace stellate::cli {

DoctorCommand::DoctorCommand(CLI::App& parent)
    : command_(parent.add_subcommand(
          "doctor", "Probe an oracle for its contract, and say in words what is wrong")) {
  command_->add_option("manifold", manifold_, "e.g. torus:1:0.4; see 'stellate list'")->required();
  command_->add_option("-e,--epsilon", options_.epsilon, "that a mesh is planned with");
  command_->add_option("--seed", options_.random_seed, "of the random questions")
      ->capture_default_str();
  command_->footer(
      "An oracle of your own: python3 -m stellate doctor MODULE:OBJECT, or stellate::Check in "
      "C++.\nExit status: 0 it keeps its contract, 1 it does not, 2 usage.");
}

int DoctorCommand::Run() const {
  std::string why;
  const std::unique_ptr<Manifold> manifold = MakeManifold(manifold_, &why);
  if (manifold == nullptr) {
    return Complain({ErrorCode::kRefused, "", why + "; 'stellate list' shows what there is"});
  }
  const CheckReport report = Check(*manifold, options_);
  std::cout << ToText(report);
  return report.ok() ? kExitCertified : kExitNotCertified;
}

}  // namespace stellate::cli
