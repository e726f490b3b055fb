#include "report_output.h"

#include <CLI/CLI.hpp>
#include <iostream>

#include "exit_status.h"
#include "server_options.h"

namespace stellate::cli {

void ReportOutput::AddTo(CLI::App* command) {
  command->add_option("--report", path_, "file for the report as JSON");
  command->add_flag("--json", json_, "print the report as JSON");
  command->add_flag("-q,--quiet", quiet_, "no progress and no report");
}

int ReportOutput::Write(const Report& report, const std::string& text,
                        const std::vector<Error>& failures) const {
  int status = report.certified() ? kExitCertified : kExitNotCertified;
  for (const Error& failure : failures) status = PrintError(failure);
  if (!path_.empty()) {
    const Expected<void> saved = SaveJson(report, path_);
    if (!saved) status = PrintError(saved.error());
  }
  if (json_) {
    std::cout << ToJson(report) << "\n";
  } else if (!quiet_) {
    PrintText(text);
  }
  return status;
}

}  // namespace stellate::cli
