#include "declare_command.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <iostream>
#include <utility>

#include "mesh_settings.h"
#include "stellate/serve.h"

namespace stellate::cli {

DeclareCommand::DeclareCommand(CLI::App& parent)
    : command_(parent.add_subcommand("declare",
                                     "Declare a mesh, for others to serve, and print its name")),
      source_(command_),
      server_(command_, "127.0.0.1:7717"),
      spec_(command_, /*serves=*/false) {
  command_->add_option("--label", label_,
                       "the mesh's name in lists; default: the manifold or the command");
  command_->footer(
      "'stellate serve' answers for it, 'stellate download' fetches it.\n"
      "Exit status: 0 declared, 2 usage or refused, 3 server or oracle failed.");
}

int DeclareCommand::Run(std::stop_token stop) {
  const Expected<std::unique_ptr<Oracle>> oracle = source_.Make(std::move(stop));
  if (!oracle) return PrintError(oracle.error());
  Expected<Connection> connection = server_.Read();
  if (!connection) return PrintError(connection.error());
  MeshOptions& options = spec_.options;
  options.connection = std::move(*connection);
  spec_.SetLabel(label_.empty() ? source_.name() : label_);
  options.on_epsilon = [](double epsilon, const std::string& reason) {
    std::fprintf(stderr, "epsilon %g, %s\n", epsilon, reason.c_str());
  };
  try {
    const Expected<std::string> name = DeclareMesh(**oracle, options);
    if (!name) {
      Error error = name.error();
      error.message = InFlags(error.message);
      return PrintError(error);
    }
    std::cout << *name << "\n";
    return kExitCertified;
  } catch (const std::exception& e) {
    return PrintError({ErrorCode::kOracleFailed, e.what(), {}});
  }
}

}  // namespace stellate::cli
