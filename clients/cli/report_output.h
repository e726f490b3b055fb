#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

#include "stellate/error.h"
#include "stellate/report.h"

namespace stellate::cli {

// Where a command that makes or fetches a mesh says how that ended, and by which exit status.
class ReportOutput {
 public:
  // Adds its flags to the command.
  void AddTo(CLI::App* command);

  bool is_quiet() const { return quiet_; }

  // Writes the report; `text` is for people. `failures`: of files of the mesh. Returns the
  // command's exit status.
  int Write(const Report& report, const std::string& text,
            const std::vector<Error>& failures) const;

 private:
  std::string path_;
  bool json_ = false, quiet_ = false;
};

}  // namespace stellate::cli
