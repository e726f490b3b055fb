#include "mesh_command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <memory>
#include <utility>

#include "mesh_settings.h"
#include "progress_bar.h"

namespace stellate::cli {
namespace {

// Hides all but closest_point, to see what a mesh costs a client that has nothing else.
class ClosestPointOnly final : public Oracle {
 public:
  explicit ClosestPointOnly(Oracle& oracle) : oracle_(oracle) {}
  int dimension() const override { return oracle_.dimension(); }
  int ambient_dimension() const override { return oracle_.ambient_dimension(); }
  Answer ClosestPoint(const Eigen::MatrixXd& x) override { return oracle_.ClosestPoint(x); }
  std::optional<BoundingBox> bounding_box() const override { return oracle_.bounding_box(); }
  Eigen::VectorXd coordinate_scale() const override { return oracle_.coordinate_scale(); }

 private:
  Oracle& oracle_;
};

}  // namespace

MeshCommand::MeshCommand(CLI::App& parent)
    : command_(parent.add_subcommand(
          "mesh", "Mesh a manifold of the catalogue, a solid, or the manifold of a command")),
      source_(command_),
      server_(command_, ""),
      spec_(command_, /*serves=*/true) {
  server_.AddReconnect(command_);
  outputs_.AddTo(command_);
  command_->add_flag("--closest-point-only", closest_point_only_,
                     "offer neither flat intersections nor tangent bases");
  report_.AddTo(command_);
  command_->footer(
      "Exit status: 0 certified, 1 not certified, 2 usage or refused, 3 server or oracle failed.");
}

int MeshCommand::Run(std::stop_token stop) {
  const Expected<std::unique_ptr<Oracle>> made = source_.Make(stop, report_.is_quiet());
  if (!made) return PrintError(made.error());
  Oracle& oracle = **made;
  if (closest_point_only_ && oracle.walls() > 0) {
    return PrintError({ErrorCode::kRefused, "",
                       "--closest-point-only: a manifold with boundary takes tangent bases"});
  }
  const int dimension = oracle.dimension() - (options_.boundary_only.value_or(false) ? 1 : 0);
  if (const auto ok = outputs_.Check(dimension, oracle.ambient_dimension()); !ok) {
    return PrintError(ok.error());
  }
  Expected<Connection> connection = server_.Read();
  if (!connection) return PrintError(connection.error());
  options_.connection = std::move(*connection);
  spec_.SetLabel("stellate mesh " + source_.name());
  options_.workers = std::max(options_.workers, source_.processes());
  options_.stop = std::move(stop);
  ClosestPointOnly poor(oracle);
  const Expected<SavedMesh> mesh =
      MeshIt(closest_point_only_ ? static_cast<Oracle&>(poor) : oracle);
  if (mesh) return report_.Write(mesh->report, mesh->report.text, mesh->failures);
  Error error = mesh.error();
  error.message = InFlags(error.message);
  return PrintError(error);
}

Expected<SavedMesh> MeshCommand::MeshIt(Oracle& oracle) {
  ProgressBar bar(report_.is_quiet());
  options_.on_epsilon = [this, &bar](double epsilon, const std::string& reason) {
    bar.Clear();
    if (!report_.is_quiet()) std::fprintf(stderr, "epsilon %g, %s\n", epsilon, reason.c_str());
  };
  options_.on_progress = [&bar](const Progress& progress) { bar.Show(progress); };
  options_.on_part = [&bar](auto received, auto all) { bar.ShowPart(received, all); };
  options_.connection.on_outage = [this, &bar](const Outage& outage) {
    bar.Clear();
    PrintOutage(outage, options_.connection.reconnect);
  };
  try {
    Expected<SavedMesh> mesh = MeshManifoldTo(oracle, outputs_.paths(), options_);
    bar.Clear();
    return mesh;
  } catch (const std::exception& e) {
    bar.Clear();
    return Fail(ErrorCode::kOracleFailed, e.what());
  }
}

}  // namespace stellate::cli
