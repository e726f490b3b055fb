#pragma once

#include <CLI/CLI.hpp>

namespace stellate::cli {

// `stellate conform`: hands over to the Python client, which has it. The kit says on purpose what
// no library of a server would: that is little work where messages are made up as a program runs.
class ConformCommand {
 public:
  explicit ConformCommand(CLI::App& parent);
  bool chosen() const { return command_->parsed(); }
  // Becomes `python -m stellate conform`; comes back only where there is none.
  int Run();

 private:
  CLI::App* const command_;
};

}  // namespace stellate::cli
