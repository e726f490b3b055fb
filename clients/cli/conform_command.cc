#include "conform_command.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

#include "exit_status.h"

namespace stellate::cli {
namespace {

// Whether this Python has the kit, and all that it imports.
bool HasKit(const char* python) {
  std::array<char*, 4> arguments = {const_cast<char*>(python), const_cast<char*>("-c"),
                                    const_cast<char*>("import stellate_conform.command"), nullptr};
  posix_spawn_file_actions_t quiet;
  posix_spawn_file_actions_init(&quiet);
  posix_spawn_file_actions_addopen(&quiet, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int failed = posix_spawnp(&child, python, &quiet, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&quiet);
  if (failed != 0) return false;
  int status = 0;
  return waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace

ConformCommand::ConformCommand(CLI::App& parent) {
  parent.add_subcommand("conform", "Hold a client in any language to the rules of the protocol");
}

int ConformCommand::Run(int count, char** arguments) {
  for (const char* const python : {"python3", "/usr/bin/python3"}) {
    if (!HasKit(python)) continue;
    std::vector<std::string> words = {python, "-m", "stellate_conform"};
    words.insert(words.end(), arguments, arguments + count);
    std::vector<char*> line;
    line.reserve(words.size() + 1);
    for (std::string& word : words) line.push_back(word.data());
    line.push_back(nullptr);
    execvp(python, line.data());
  }
  std::cerr
      << "stellate: the conformance kit is a Python package of its own, which no python3 here has: "
         "in Stellate's sources, pip install ./clients/python ./clients/conform\n";
  return kExitFailed;
}

}  // namespace stellate::cli
