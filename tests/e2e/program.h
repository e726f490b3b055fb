#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <string>

#include "live.h"

namespace stellate::testing {

// Runs `stellate`, beside a server or on that server.
class CommandLine : public Live {
 protected:
  struct Result {
    int status = -1;
    std::string output;  // standard output and error together
  };
  // All programs of a build lie in one directory.
  static std::string Program() {
    return (std::filesystem::read_symlink("/proc/self/exe").parent_path() / "stellate").string();
  }
  static Result Run(const std::string& arguments) {
    Result result;
    const std::string command = std::string("'").append(Program()) + "' " + arguments + " 2>&1";
    std::FILE* pipe = popen(command.c_str(), "r");
    if (pipe == nullptr) return result;
    std::array<char, 4096> buffer;
    while (const size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe)) {
      result.output.append(buffer.data(), count);
    }
    const int status = pclose(pipe);
    if (WIFEXITED(status)) result.status = WEXITSTATUS(status);
    return result;
  }
  static Result OnServer(const std::string& arguments) {
    return Run(arguments + " --server '" + Server() + "'");
  }
};

}  // namespace stellate::testing
