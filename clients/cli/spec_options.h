#pragma once

#include <CLI/App.hpp>
#include <string>

#include "stellate/client.h"

namespace stellate::cli {

// The options that say what to mesh and how: epsilon, budgets, criteria, audit.
class SpecOptions {
 public:
  // `serves`: the command answers the questions, too, and takes what is for that.
  SpecOptions(CLI::App* command, bool serves);
  SpecOptions(const SpecOptions&) = delete;
  SpecOptions& operator=(const SpecOptions&) = delete;

  // `text` shown in lists and logs, as far as servers take it.
  void SetLabel(const std::string& text);

  MeshOptions options;

 private:
  void SetEpsilon(const std::string& text);
};

}  // namespace stellate::cli
