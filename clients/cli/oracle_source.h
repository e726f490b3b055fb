#pragma once

#include <CLI/App.hpp>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "stellate/command_oracle.h"
#include "stellate/error.h"
#include "stellate/oracle.h"

namespace stellate::cli {

// Whose manifold it is: one of the catalogue's, what walls leave of it, a solid or several
// materials (docs/using/solids.md), or that of a command (docs/using/pipe.md).
class OracleSource {
 public:
  explicit OracleSource(CLI::App* command);

  // The oracle, its processes started. A stop ends them. What a command keeps waiting is said on
  // standard error, unless `quiet`.
  Expected<std::unique_ptr<Oracle>> Make(std::stop_token stop, bool quiet = false);

  // For labels and messages.
  std::string name() const;
  // How many of them answer at the same time; 1 for the catalogue's.
  int processes() const { return command_.processes; }

 private:
  Expected<void> ReadWhereabouts();
  Expected<std::unique_ptr<Oracle>> MakeSolid() const;
  Expected<std::unique_ptr<Oracle>> MakeUnclipped(std::stop_token stop, bool quiet);

  std::string manifold_, solid_, box_;
  std::vector<std::string> seeds_, clips_, materials_;
  std::vector<double> scale_;
  CommandOptions command_;
};

}  // namespace stellate::cli
