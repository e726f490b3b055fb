#include "reconstruct_command.h"

#include <CLI/CLI.hpp>
#include <exception>
#include <utility>

#include "progress_bar.h"
#include "stellate/oracles/points.h"

namespace stellate::cli {

ReconstructCommand::ReconstructCommand(CLI::App& parent)
    : command_(parent.add_subcommand("reconstruct", "Make a mesh of points on a manifold")),
      server_(command_, "") {
  command_
      ->add_option("points", points_,
                   ".ply, .npy, .csv, .xyz or .txt; -: a point a line from standard input")
      ->required();
  const CLI::Option* const dimension =
      command_
          ->add_option("-k,--dimension", options_.dimension,
                       "dimension of the manifold, 1 to 3: 1 for a curve, 2 for a surface")
          ->type_name("INT REQUIRED");
  // CLI11 would say only that it is required.
  command_->final_callback([dimension] {
    if (dimension->count() > 0) return;
    throw CLI::RequiredError(
        "-k is required: the dimension of the manifold that the points lie on, 1 for a curve, 2 "
        "for a surface",
        CLI::ExitCodes::RequiredError);
  });
  outputs_.AddTo(command_);
  command_->add_option("--ambient", coordinates_,
                       "coordinates of a point; the first of each line, where there are more");
  command_
      ->add_option(
          "--columns", columns_,
          "the columns that are coordinates, by their titles, or their numbers from 1: x,y,z")
      ->delimiter(',')
      ->excludes("--ambient");
  command_->add_option("--noise", options_.noise,
                       "standard deviation of each coordinate, a length; 0: none; default: as the "
                       "points show");
  command_->add_option("--reach", options_.reach,
                       "a lower bound of the manifold's reach, from which the mesh may be proved");
  command_->add_option("--drop", options_.drop, "share of the points that may be left out")
      ->capture_default_str();
  command_->add_flag("--open", open_, "the manifold may have a boundary");
  command_
      ->add_option(
          "--weights",
          [this](const CLI::results_t& given) {
            options_.weights = given.back() == "only" ? Weighting::kOnly : Weighting::kAsNeeded;
            return true;
          },
          "auto: of points where tilings do not make stars agree; only: no tilings, the weighted "
          "tangential Delaunay complex")
      ->check(CLI::IsMember({"auto", "only"}))
      ->type_name("HOW")
      ->default_str("auto");
  command_->add_flag(
      "--steiner", options_.steiner,
      "vertices may be added, after the points, where nothing else makes stars agree");
  command_
      ->add_option("--scale", options_.scale,
                   "where axes have different units: how far the manifold goes along each, "
                   ".01,500,1; noise, reach and the report are of points / scale")
      ->delimiter(',');
  server_.AddReconnect(command_);
  report_.AddTo(command_);
  command_->footer(
      "Exit status: 0 certified, 1 not certified, 2 usage or refused, 3 server failed.");
}

int ReconstructCommand::Run(std::stop_token stop) {
  Eigen::MatrixXd points;
  try {
    points = oracles::ReadPoints(points_, coordinates_, columns_);
  } catch (const std::exception& error) {
    return PrintError({ErrorCode::kRefused, "", error.what()});
  }
  const auto d = static_cast<int>(points.rows());
  if (const auto ok = outputs_.Check(options_.dimension, d); !ok) return PrintError(ok.error());
  Expected<Connection> connection = server_.Read();
  if (!connection) return PrintError(connection.error());
  options_.connection = std::move(*connection);
  options_.closed = !open_;
  options_.label = "stellate reconstruct";
  options_.stop = std::move(stop);
  ProgressBar bar(report_.is_quiet());
  options_.on_progress = [&bar](const Progress& progress) { bar.Show(progress); };
  options_.connection.on_outage = [this, &bar](const Outage& outage) {
    bar.Clear();
    PrintOutage(outage, options_.connection.reconnect);
  };
  const Expected<Mesh> mesh = Reconstruct(points, options_);
  bar.Clear();
  if (!mesh) return PrintError(mesh.error());
  return report_.Write(mesh->report, mesh->report.text, outputs_.Write(*mesh));
}

}  // namespace stellate::cli
