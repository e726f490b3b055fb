#include "cancel_command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "stellate/monitor.h"
#include "text/printable.h"

namespace stellate::cli {
namespace {

constexpr std::string_view kPrefix = "meshes/";

// The one mesh whose name begins so, with or without "meshes/".
Expected<std::string> FindMesh(const std::vector<MeshStatus>& meshes, const std::string& begin) {
  const std::string whole = begin.rfind(kPrefix, 0) == 0 ? begin : std::string(kPrefix) + begin;
  std::vector<std::string> found;
  for (const MeshStatus& mesh : meshes)
    if (mesh.name.rfind(whole, 0) == 0) found.push_back(mesh.name);
  if (found.size() == 1) return found[0];
  return Fail(ErrorCode::kRefused,
              found.empty() ? "there is no mesh " + begin + ": `stellate top` shows which there are"
                            : std::to_string(found.size()) + " meshes begin with " + begin +
                                  ": give more of the name",
              found.empty() ? "MESH_NOT_FOUND" : "INVALID_ARGUMENT");
}

}  // namespace

CancelCommand::CancelCommand(CLI::App& parent)
    : command_(parent.add_subcommand("cancel", "End meshes that run on a server")),
      server_(command_, "127.0.0.1:7717") {
  command_->add_option("mesh", meshes_, "its name, or as much of it as `stellate top` shows")
      ->required();
  command_->add_flag("--delete", forget_, "delete them too, with what was meshed so far");
  command_->footer(
      "An administrator's token ends the meshes of all owners. Exit status: 0 done, 2 usage or "
      "refused, 3 no server.");
}

int CancelCommand::Run() const {
  const Expected<Connection> connection = server_.Read();
  if (!connection) return PrintError(connection.error());
  Expected<Monitor> monitor = Monitor::Connect(*connection);
  if (!monitor) return PrintError(monitor.error());
  const Expected<std::vector<MeshStatus>> meshes = monitor->Meshes();
  if (!meshes) return PrintError(meshes.error());
  for (const std::string& begin : meshes_) {
    const Expected<std::string> name = FindMesh(*meshes, begin);
    if (!name) return PrintError(name.error());
    const Expected<void> done = forget_ ? monitor->Delete(*name) : monitor->Cancel(*name);
    if (!done) return PrintError(done.error());
    std::printf("%s %s\n", text::Printable(*name, '?').c_str(), forget_ ? "deleted" : "cancelled");
  }
  return kExitCertified;
}

}  // namespace stellate::cli
