#include "serve_command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <exception>
#include <iostream>
#include <thread>
#include <utility>
#include <vector>

namespace stellate::cli {

ServeCommand::ServeCommand(CLI::App& parent)
    : command_(parent.add_subcommand(
          "serve", "Answer for a mesh that somebody else declared, until it is over")),
      name_(command_->add_option("mesh", mesh_, "its name, meshes/...")->required()),
      source_(command_),
      server_(command_, "127.0.0.1:7717") {
  command_->add_option("--worker", options_.worker, "this worker's name, for logs");
  command_->add_option("--max-chunk", options_.max_chunk, "most points in one call of the oracle");
  server_.AddReconnect(command_);
  command_->footer(
      "All workers of a mesh have to answer for one manifold.\n"
      "Exit status: 0 the mesh succeeded, 1 it ended otherwise or this worker was stopped, 2 usage "
      "or refused, 3 server or oracle failed.");
}

int ServeCommand::Run(std::stop_token stop) {
  const Expected<std::unique_ptr<Oracle>> oracle = source_.Make(stop);
  if (!oracle) return PrintError(oracle.error());
  Expected<Connection> connection = server_.Read();
  if (!connection) return PrintError(connection.error());
  options_.connection = std::move(*connection);
  options_.connection.on_outage = [this](const Outage& outage) {
    PrintOutage(outage, options_.connection.reconnect);
  };
  options_.stop = std::move(stop);
  const Expected<MeshState> state = Serve(**oracle);
  if (options_.stop.stop_requested()) {
    std::cerr << "stellate: this worker left; others have its work\n";
    return kExitNotCertified;
  }
  if (!state) return PrintError(state.error());
  std::cout << mesh_ << " " << MeshStateName(*state) << "\n";
  return *state == MeshState::kSucceeded ? kExitCertified : kExitNotCertified;
}

// As many workers as there are processes to ask, each over a stream of its own. All hear how the
// mesh ended; the first error is that of all.
Expected<MeshState> ServeCommand::Serve(Oracle& oracle) {
  const auto count = static_cast<size_t>(source_.processes());
  std::vector<Expected<MeshState>> ends(count, MeshState::kUnknown);
  std::vector<std::thread> threads;
  threads.reserve(count);
  for (Expected<MeshState>& end : ends) {
    threads.emplace_back([&end, &oracle, this] {
      try {
        end = ServeMesh(oracle, mesh_, options_);
      } catch (const std::exception& e) {
        end = Fail(ErrorCode::kOracleFailed, e.what());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  const auto failed = std::find_if(ends.begin(), ends.end(), [](const auto& end) { return !end; });
  return failed == ends.end() ? ends.front() : *failed;
}

}  // namespace stellate::cli
