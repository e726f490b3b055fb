// stellate-mpi: `stellate mesh` in the ranks of an MPI job, without a server.
#include <mpi.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <iostream>
#include <sstream>
#include <utility>

#include "exit_status.h"
#include "mesh_in_parts.h"
#include "mesh_settings.h"
#include "oracle_source.h"
#include "outputs.h"
#include "progress_bar.h"
#include "report_output.h"
#include "server_options.h"
#include "spec_options.h"
#include "stellate/version.h"

namespace {

using stellate::Error;
using stellate::ErrorCode;
using stellate::Expected;
using stellate::Oracle;
using stellate::SavedMesh;
namespace cli = stellate::cli;

int RankOf(MPI_Comm comm) {
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  return rank;
}

constexpr const char* kWhat =
    "Meshes one manifold in the ranks of an MPI job, without a server:\n\n"
    "  mpirun -n 64 stellate-mpi mesh torus -e 0.01 -o torus.vtu\n\n"
    "Each rank starts an oracle of its own. The questions of each round are shared out among all, "
    "and so is most of the computing. Every rank holds the whole mesh: more ranks make a mesh "
    "sooner, and none larger. The first writes the files, but pieces of .pvtu, and the mesh is the "
    "same for any number of ranks. docs/using/large.md";

// `stellate-mpi mesh`.
class PartCommand {
 public:
  explicit PartCommand(CLI::App& parent)
      : command_(parent.add_subcommand(
            "mesh", "Mesh a manifold of the catalogue, a solid, or the manifold of a command")),
        source_(command_),
        spec_(command_, /*serves=*/true) {
    CLI::Option* const output = outputs_.AddTo(command_);
    output->description(output->get_description() +
                        ". name.pvtu: for ParaView, a piece a rank, which each writes itself, in "
                        "a folder `name` beside it");
    report_.AddTo(command_);
    command_->footer(
        "Exit status, of all ranks: 0 certified, 1 not certified, 2 usage or refused, 3 an oracle "
        "failed. A rank that dies ends all, and no file is written.");
  }

  int Run() {
    const bool is_first = RankOf(MPI_COMM_WORLD) == 0;
    cli::ProgressBar bar(!is_first || report_.is_quiet());
    spec_.options.workers = std::max(spec_.options.workers, source_.processes());
    spec_.options.on_progress = [&bar](const stellate::Progress& progress) { bar.Show(progress); };
    Expected<std::unique_ptr<Oracle>> oracle = source_.Make({});
    if (oracle && HasServerTimes())
      oracle = stellate::Fail(ErrorCode::kRefused,
                              "--worker-wait, --answer and --busy are for servers: ranks wait for "
                              "each other as long as it takes");
    const Expected<SavedMesh> mesh =
        stellate::mpi::MeshInPartsTo(oracle, outputs_.paths(), spec_.options, MPI_COMM_WORLD);
    bar.Clear();
    if (mesh) {
      if (is_first) return report_.Write(mesh->report, mesh->report.text, mesh->failures);
      return mesh->report.certified() ? cli::kExitCertified : cli::kExitNotCertified;
    }
    Error error = mesh.error();
    error.message = cli::InFlags(error.message);
    return is_first ? cli::PrintError(error) : cli::ExitStatusOf(error);
  }

 private:
  bool HasServerTimes() const {
    const stellate::MeshOptions& options = spec_.options;
    return options.worker_wait || options.answer_time || options.busy_time;
  }

  CLI::App* command_;
  cli::OracleSource source_;
  cli::SpecOptions spec_;
  cli::Outputs outputs_;
  cli::ReportOutput report_;
};

int Main(int argc, char** argv) {
  CLI::App app(kWhat, "stellate-mpi");
  app.set_version_flag("--version", "stellate-mpi " STELLATE_VERSION);
  app.require_subcommand(1);
  PartCommand mesh(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // Help and version come this way too, with status 0. All ranks have the same to say.
    std::ostringstream out, err;
    const int status = app.exit(error, out, err);
    if (RankOf(MPI_COMM_WORLD) == 0) {
      std::cout << out.str();
      std::cerr << err.str();
    }
    return status == 0 ? cli::kExitCertified : cli::kExitRefused;
  }
  return mesh.Run();
}

}  // namespace

int main(int argc, char** argv) {
  int provided = 0;
  // The thread that calls MPI is not always the first, but there is one at a time.
  MPI_Init_thread(&argc, &argv, MPI_THREAD_SERIALIZED, &provided);
  int status = cli::kExitFailed;
  if (provided < MPI_THREAD_SERIALIZED) {
    std::cerr << "stellate-mpi: this MPI takes calls of one thread alone\n";
    MPI_Abort(MPI_COMM_WORLD, status);
  }
  try {
    status = Main(argc, argv);
  } catch (const std::exception& error) {  // others would wait for this rank
    std::cerr << "stellate-mpi: rank " << RankOf(MPI_COMM_WORLD) << ": " << error.what() << "\n";
    MPI_Abort(MPI_COMM_WORLD, status);
  }
  MPI_Finalize();
  return status;
}
