#include "mesh_command.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <utility>

#include "progress_bar.h"
#include "stellate/catalogue.h"

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

 private:
  Oracle& oracle_;
};

}  // namespace

void AddCredentials(CLI::App* command, Credentials* credentials, std::string* token_file) {
  const std::string group = "Safety";
  command->add_flag("--tls", credentials->tls, "TLS, trusting the system's authorities")
      ->group(group);
  command->add_option("--tls-ca", credentials->tls_ca, "PEM file: TLS, trusting these instead")
      ->group(group);
  command
      ->add_option("--tls-cert", credentials->tls_certificate,
                   "PEM file with a client certificate, where the server asks for one")
      ->group(group);
  command->add_option("--tls-key", credentials->tls_key, "PEM file with its key")->group(group);
  command
      ->add_option("--token-file", *token_file,
                   "file that holds the token alone; default: $STELLATE_TOKEN, if set")
      ->group(group);
}

Expected<void> Authorize(const std::string& token_file, Credentials* credentials) {
  if (token_file.empty()) {
    const char* const token = std::getenv("STELLATE_TOKEN");
    if (token != nullptr) credentials->token = token;
    return {};
  }
  std::ifstream file(token_file);
  std::string rest;
  if (!(file >> credentials->token) || file >> rest) {
    return Fail(ErrorCode::kRefused, token_file + " must hold one token and nothing else");
  }
  return {};
}

int Complain(const Error& error) {
  std::cerr << "stellate: " << (error.reason.empty() ? "" : error.reason + ": ") << error.message
            << "\n";
  const bool ours = error.code == ErrorCode::kRefused || error.code == ErrorCode::kFileFailed;
  return ours ? kExitRefused : kExitFailed;
}

MeshCommand::MeshCommand(CLI::App& parent)
    : command_(parent.add_subcommand("mesh", "Mesh a manifold of the catalogue")) {
  command_->add_option("manifold", manifold_, "e.g. torus:1:0.4; see 'stellate list'")->required();
  command_
      ->add_option("-e,--epsilon", options_.epsilon, "largest circumradius of a simplex, a length")
      ->required();
  command_->add_option("--server", options_.server,
                       "host:port or unix:/path; default: a private one is started");
  AddCredentials(command_, &options_.credentials, &token_file_);
  command_->add_option("-o,--output", outputs_,
                       "file to write, .txt .off .obj .ply .vtu; may be given again");
  command_->add_option("--seed", options_.random_seed, "seed of everything random")
      ->capture_default_str();
  command_->add_option("--workers", options_.workers, "threads that answer the server")
      ->capture_default_str();
  command_->add_option("--max-vertices", options_.max_vertices, "stop there");
  command_->add_option("--max-rounds", options_.max_rounds, "stop after so many round trips");
  command_->add_option("--box-seeds", options_.box_seeds, "points of the box tried as seeds");
  AddCriteria();
  command_->add_flag("--closest-point-only", closest_point_only_,
                     "offer neither flat intersections nor tangent bases");
  command_->add_flag("--json", json_, "print the report as JSON");
  command_->add_flag("-q,--quiet", quiet_, "no progress and no report");
  command_->footer(
      "Exit status: 0 certified, 1 not certified, 2 usage or refused, 3 server or oracle failed.");
}

void MeshCommand::AddCriteria() {
  const std::string group = "Criteria (absent: the server's defaults)";
  command_->add_option("--radius-edge", options_.radius_edge_bound, "rho0 of rule R2")
      ->group(group);
  command_->add_option("--sliver", options_.sliver_bound, "Theta0 of rule R3, 0: off")
      ->group(group);
  command_->add_option("--picking-radius", options_.picking_radius, "delta of the picking region")
      ->group(group);
  command_
      ->add_option("--small-sliver-radius", options_.small_sliver_radius,
                   "beta: which slivers count against a candidate")
      ->group(group);
  command_->add_option("--candidates", options_.candidates, "tried in a picking region")
      ->group(group);
  command_->add_option("--advance-step", options_.advance_step, "h: the front's step, a length")
      ->group(group);
  command_
      ->add_option("--flat-alternations", options_.flat_alternations,
                   "closest points towards a flat, without intersections")
      ->group(group);
  command_
      ->add_flag("--ask-ahead,!--no-ask-ahead", options_.ask_ahead,
                 "refine a guess first: fewer round trips, more processor time")
      ->group(group);
  command_
      ->add_flag("--common-centre,!--no-common-centre", options_.common_centre,
                 "judge a simplex at one centre for all its vertices")
      ->group(group);
}

int MeshCommand::Run(std::stop_token stop) {
  std::string why;
  const std::unique_ptr<Manifold> manifold = MakeManifold(manifold_, &why);
  if (manifold == nullptr) {
    return Complain({ErrorCode::kRefused, "", why + "; 'stellate list' shows what there is"});
  }
  if (!options_.server.empty()) {
    const Expected<void> authorized = Authorize(token_file_, &options_.credentials);
    if (!authorized) return Complain(authorized.error());
  }
  ClosestPointOnly poor(*manifold);
  Oracle& oracle = closest_point_only_ ? static_cast<Oracle&>(poor) : *manifold;
  ProgressBar bar(quiet_);
  options_.label = "stellate mesh " + manifold_;
  if (options_.label.size() > 128) options_.label.resize(128);
  options_.stop = std::move(stop);
  options_.on_progress = [&bar](const Progress& progress) { bar.Show(progress); };
  const Expected<Mesh> mesh = MeshManifold(oracle, options_);
  bar.Clear();
  if (!mesh) return Complain(mesh.error());
  int status = mesh->report.certified() ? kExitCertified : kExitNotCertified;
  for (const std::string& path : outputs_) {
    if (const Expected<void> saved = mesh->Save(path); !saved) status = Complain(saved.error());
  }
  if (json_) {
    std::cout << ToJson(mesh->report) << "\n";
  } else if (!quiet_) {
    std::cout << ToText(mesh->report);
  }
  return status;
}

}  // namespace stellate::cli
