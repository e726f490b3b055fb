#include "oracle_source.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <utility>

#include "stellate/catalogue.h"

namespace stellate::cli {

OracleSource::OracleSource(CLI::App* command) {
  CLI::Option* const manifold = command->add_option(
      "manifold", manifold_, "e.g. torus:1:0.4; see 'stellate list'. Or, instead of it, a command");
  CLI::App* const group = command->add_option_group(
      "Oracle command",
      "a program in any language that answers batches of queries: docs/using/pipe.md");
  CLI::Option* const oracle = group->add_option("--oracle-command", command_.command,
                                                "for the shell, e.g. \"octave-cli -q torus.m\"");
  oracle->excludes(manifold);
  const auto add = [&](const std::string& flags, auto& value, const std::string& help) {
    return group->add_option(flags, value, help)->needs(oracle);
  };
  add("--oracle-processes", command_.processes, "that answer, each a chunk at a time")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  add("-k,--dimension", command_.dimension, "of the manifold, unless the command says it");
  add("-d,--ambient-dimension", command_.ambient_dimension, "of space, unless the command says it");
  add("--box", box_, "where the manifold is: two corners, as --box=-1,-1,-1:1,1,1")
      ->type_name("LOWER:UPPER");
  add("--seeds", seeds_, "or points near it, one at least on each component, as --seeds=1,0,0")
      ->type_name("X,Y,...");
  add("--oracle-start", command_.start_seconds, "seconds that the command has for its first line")
      ->capture_default_str();
  add("--oracle-silence", command_.silence_seconds,
      "seconds that it may neither read nor write while it answers a batch")
      ->capture_default_str();
}

Expected<void> OracleSource::ReadWhereabouts() {
  if (!box_.empty()) {
    Expected<BoundingBox> box = ParseBox(box_);
    if (!box) return tl::unexpected(box.error());
    command_.box = std::move(*box);
  }
  std::string all;
  for (const std::string& seed : seeds_) all += (all.empty() ? "" : ";") + seed;
  if (all.empty()) return {};
  Expected<Eigen::MatrixXd> points = ParsePoints(all);
  if (!points) return tl::unexpected(points.error());
  command_.seeds = std::move(*points);
  return {};
}

Expected<std::unique_ptr<Oracle>> OracleSource::Make(std::stop_token stop) {
  if (command_.command.empty()) {
    std::string why = "name a manifold, or give --oracle-command";
    std::unique_ptr<Oracle> known;
    if (!manifold_.empty()) known = MakeManifold(manifold_, &why);
    if (known != nullptr) return known;
    return Fail(ErrorCode::kRefused, why + "; 'stellate list' shows what there is");
  }
  if (const auto ok = ReadWhereabouts(); !ok) return tl::unexpected(ok.error());
  command_.stop = std::move(stop);
  command_.on_restart = [](const std::string& how) {
    std::fprintf(stderr, "stellate: %s\nstellate: it is started again\n", how.c_str());
  };
  return StartCommand(command_);
}

}  // namespace stellate::cli
