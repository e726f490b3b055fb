#pragma once

#include <CLI/CLI.hpp>

namespace stellate::cli {

// `stellate conform`: hands over to the Python package stellate-conform (clients/conform), or says
// how to get it. The kit says on purpose what no library of a server would: that is little work
// where messages are made up as a program runs.
class ConformCommand {
 public:
  explicit ConformCommand(CLI::App& parent);  // for the list of commands
  // Becomes `python -m stellate_conform` with these arguments, as they are: "--" means something
  // there. Comes back only where there is no such Python.
  static int Run(int count, char** arguments);
};

}  // namespace stellate::cli
