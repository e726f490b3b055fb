#include "download_command.h"

#include <CLI/CLI.hpp>
#include <utility>

#include "progress_bar.h"

namespace stellate::cli {

DownloadCommand::DownloadCommand(CLI::App& parent)
    : command_(parent.add_subcommand("download", "Fetch a mesh that is on a server")),
      server_(command_, "127.0.0.1:7717") {
  command_->add_option("mesh", mesh_, "its whole name: meshes/ and 32 digits")->required();
  outputs_.AddTo(command_)->required();
  CLI::Option* const wait =
      command_->add_flag("--wait", wait_, "wait for the end of a mesh that is not over");
  command_
      ->add_flag("--unfinished", unfinished_,
                 "take a mesh as it is, even if it has failed or still grows")
      ->excludes(wait);
  command_
      ->add_option("--revision", options_.revision,
                   "which of those that the mesh has had, counted from 1; default: the newest")
      ->check(CLI::PositiveNumber)
      ->excludes(wait);
  server_.AddReconnect(command_);
  report_.AddTo(command_);
  command_->footer(
      "Exit status: 0 certified, 1 not certified, 2 usage or refused, 3 server or oracle failed.");
}

int DownloadCommand::Run(std::stop_token stop) {
  Expected<Connection> connection = server_.Read();
  if (!connection) return PrintError(connection.error());
  options_.connection = std::move(*connection);
  if (wait_) options_.unfinished = Unfinished::kWait;
  if (unfinished_) options_.unfinished = Unfinished::kTake;
  ProgressBar bar(report_.is_quiet());
  options_.stop = std::move(stop);
  options_.on_progress = [&bar](const Progress& progress) { bar.Show(progress); };
  options_.on_part = [&bar](auto received, auto all) { bar.ShowPart(received, all); };
  options_.connection.on_outage = [this, &bar](const Outage& outage) {
    bar.Clear();
    PrintOutage(outage, options_.connection.reconnect);
  };
  const Expected<SavedMesh> mesh = DownloadMeshTo(mesh_, outputs_.paths(), options_);
  bar.Clear();
  return mesh ? Deliver(*mesh) : PrintError(mesh.error());
}

int DownloadCommand::Deliver(const SavedMesh& mesh) const {
  const bool has_report = mesh.report.termination != Termination::kUnknown;
  const std::string counts = std::to_string(mesh.vertices) + " vertices, " +
                             std::to_string(mesh.simplices) +
                             " simplices, not the end of the mesh\n";
  return report_.Write(mesh.report, has_report ? mesh.report.text : counts, mesh.failures);
}

}  // namespace stellate::cli
