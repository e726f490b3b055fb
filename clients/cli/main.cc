// stellate: meshes the catalogue's manifolds, and those of commands, from the command line.
#include <signal.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <iostream>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>

#include "cancel_command.h"
#include "conform_command.h"
#include "declare_command.h"
#include "doctor_command.h"
#include "download_command.h"
#include "mesh_command.h"
#include "reconstruct_command.h"
#include "serve_command.h"
#include "server_options.h"
#include "stellate/catalogue.h"
#include "stellate/client.h"
#include "stellate/oracles/walls.h"
#include "stellate/version.h"
#include "top_command.h"
#include "view_command.h"

namespace {

using stellate::cli::PrintError;

// SIGINT and SIGTERM become a request to stop. Made before any other thread, so that all of them
// leave the signals to this one's. A second signal ends the program at once.
class StopOnSignal {
 public:
  StopOnSignal() {
    sigemptyset(&signals_);
    for (const int signal : {SIGINT, SIGTERM, SIGUSR1}) sigaddset(&signals_, signal);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
    thread_ = std::thread([this] {
      int signal = 0;
      sigwait(&signals_, &signal);
      if (signal == SIGUSR1) return;  // from the destructor
      std::thread([source = source_]() mutable { source.request_stop(); }).detach();
      do {
        sigwait(&signals_, &signal);
      } while (signal != SIGUSR1 && signal != SIGINT && signal != SIGTERM);
      if (signal != SIGUSR1) _exit(stellate::cli::kExitNotCertified);
    });
  }
  ~StopOnSignal() {
    pthread_kill(thread_.native_handle(), SIGUSR1);
    thread_.join();
  }
  std::stop_token token() const { return source_.get_token(); }

 private:
  sigset_t signals_;
  std::stop_source source_;
  std::thread thread_;
};

int List() {
  std::string syntax_width(22, ' ');
  for (const stellate::CatalogueEntry& entry : stellate::ListManifolds()) {
    std::printf("%-22s %s\n", entry.syntax.c_str(), entry.description.c_str());
    const auto manifold = stellate::MakeManifold(entry.example).value();
    const stellate::ManifoldFacts& facts = manifold->facts();
    std::string betti;
    for (const int b : facts.betti_mod2) {
      if (!betti.empty()) betti += ' ';
      betti += std::to_string(b);
    }
    std::printf("%s e.g. %s: dimension %d in R^%d, Euler characteristic %d, Betti numbers mod 2 %s",
                syntax_width.c_str(), facts.spec.c_str(), facts.dimension, facts.ambient_dimension,
                facts.euler_characteristic, betti.c_str());
    if (facts.reach) std::printf(", reach %.4g", *facts.reach);
    std::printf("\n");
  }
  std::printf("\nWith boundary, or cut any of the others with --clip:\n");
  for (const stellate::CatalogueEntry& entry : stellate::oracles::ListDomains()) {
    std::printf("%-22s %s\n", entry.syntax.c_str(), entry.description.c_str());
  }
  return stellate::cli::kExitCertified;
}

int Health(const stellate::cli::ServerOptions& server) {
  const auto connection = server.Read();
  if (!connection) return PrintError(connection.error());
  const auto health = stellate::CheckHealth(*connection);
  if (!health) return PrintError(health.error());
  std::cout << server.address() << ": " << (health->serving ? "serving" : "not serving")
            << ", stellated " << health->version << "\n"
            << "limits: dimension " << health->max_dimension << " in R^"
            << health->max_ambient_dimension << ", " << health->max_vertices << " vertices, "
            << health->max_meshes << " meshes at a time";
  if (health->owner_meshes > 0) std::cout << ", " << health->owner_meshes << " of one owner";
  std::cout << "; of one mesh " << health->max_workers << " workers, " << health->max_watchers
            << " watchers\n";
  return health->serving ? stellate::cli::kExitCertified : stellate::cli::kExitFailed;
}

int Main(int argc, char** argv) {
  CLI::App app("Meshes smooth manifolds of any dimension with a certificate.", "stellate");
  app.set_version_flag("--version", "stellate " STELLATE_VERSION);
  app.require_subcommand(1);
  stellate::cli::MeshCommand mesh(app);
  stellate::cli::ReconstructCommand reconstruct(app);
  const CLI::App* list = app.add_subcommand("list", "Show the catalogue of manifolds");
  const stellate::cli::CancelCommand cancel(app);
  const stellate::cli::ConformCommand conform(app);
  stellate::cli::DoctorCommand doctor(app);
  stellate::cli::DownloadCommand download(app);
  stellate::cli::DeclareCommand declare(app);
  stellate::cli::ServeCommand serve(app);
  const stellate::cli::TopCommand top(app);
  const stellate::cli::ViewCommand view(app);
  CLI::App* const health = app.add_subcommand("health", "Ask a server how it is");
  const stellate::cli::ServerOptions health_server(health, "127.0.0.1:7717");
  if (argc > 1 && std::string_view(argv[1]) == "conform") {
    return stellate::cli::ConformCommand::Run(argc - 2, argv + 2);
  }
  // CLI11 would say of a misspelt one that a command is required.
  if (const std::string name = argc > 1 ? argv[1] : "-"; !name.starts_with('-')) {
    const auto named = [&](const CLI::App* command) { return command->get_name() == name; };
    if (app.get_subcommands(named).empty()) {
      std::cerr << "stellate: there is no command '" << name
                << "'; stellate --help shows all of them\n";
      return stellate::cli::kExitRefused;
    }
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // Help and version come this way too, with status 0.
    return app.exit(error) == 0 ? stellate::cli::kExitCertified : stellate::cli::kExitRefused;
  }
  if (list->parsed()) return List();
  if (health->parsed()) return Health(health_server);
  const StopOnSignal signals;
  if (cancel.chosen()) return cancel.Run();
  if (doctor.chosen()) return doctor.Run(signals.token());
  if (declare.chosen()) return declare.Run(signals.token());
  if (serve.chosen()) return serve.Run(signals.token());
  if (view.chosen()) return view.Run(signals.token());
  if (reconstruct.chosen()) return reconstruct.Run(signals.token());
  if (download.chosen()) return download.Run(signals.token());
  return top.chosen() ? top.Run(signals.token()) : mesh.Run(signals.token());
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Main(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "stellate: " << error.what() << "\n";
    return stellate::cli::kExitFailed;
  }
}
