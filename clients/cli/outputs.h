#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

#include "stellate/error.h"
#include "stellate/mesh.h"

namespace stellate::cli {

// The files that a command writes a mesh to.
class Outputs {
 public:
  // Adds the flag to the command, and says on it how many there are to be.
  CLI::Option* AddTo(CLI::App* command);

  // What Write would refuse, asked before there is a mesh to lose.
  Expected<void> Check(int dimension, int ambient_dimension) const;
  // Writes all that can be written. Returns why the others cannot.
  std::vector<Error> Write(const Mesh& mesh) const;

  const std::vector<std::string>& paths() const { return paths_; }

 private:
  std::vector<std::string> paths_;
};

}  // namespace stellate::cli
