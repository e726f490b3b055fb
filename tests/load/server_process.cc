#include "tests/load/server_process.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <thread>

namespace stellate::load {
namespace {

namespace fs = std::filesystem;

}  // namespace

void Die(const std::string& message) {
  std::cerr << "load: " << message << "\n";
  std::exit(1);
}

ServerProcess::ServerProcess(const std::vector<std::string>& flags, bool durable) {
  const char* const program = std::getenv("STELLATED");
  if (program == nullptr) Die("$STELLATED must name the server's binary");
  std::string name = (fs::temp_directory_path() / "stellate-load-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) Die("cannot make a directory");
  directory_ = name;
  const std::string ready = directory_ + "/ready";
  std::vector<std::string> command{program, "--listen",    "127.0.0.1:0", "--ready-file",
                                   ready,   "--log-level", "warning"};
  command.insert(command.end(), flags.begin(), flags.end());
  if (durable) command.insert(command.end(), {"--data-dir", directory_ + "/data"});
  std::vector<char*> arguments;
  for (std::string& word : command) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_ = fork();
  if (pid_ == 0) {
    dup2(STDERR_FILENO, STDOUT_FILENO);  // what it prints is none of the results
    execv(program, arguments.data());
    _exit(127);
  }
  while (!fs::exists(ready)) {
    if (waitpid(pid_, nullptr, WNOHANG) != 0) Die("the server does not start");
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  std::ifstream(ready) >> address_;
}

ServerProcess::~ServerProcess() {
  if (pid_ > 0) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  fs::remove_all(directory_);
}

ServerProcess::Usage ServerProcess::usage() const {
  Usage usage;
  const std::string folder = "/proc/" + std::to_string(pid_);
  std::ifstream status(folder + "/status");
  for (std::string line; std::getline(status, line);) {
    std::istringstream words(line);
    std::string key;
    double value = 0;
    words >> key >> value;
    if (key == "VmRSS:") usage.resident_mb = value / 1024;
    if (key == "VmHWM:") usage.peak_mb = value / 1024;
    if (key == "Threads:") usage.threads = static_cast<int>(value);
  }
  clockid_t clock;
  timespec time{};
  if (clock_getcpuclockid(pid_, &clock) == 0 && clock_gettime(clock, &time) == 0) {
    usage.processor_seconds =
        static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  }
  return usage;
}

int ServerProcess::Stop() {
  kill(pid_, SIGTERM);
  int status = 0;
  waitpid(pid_, &status, 0);
  pid_ = 0;
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace stellate::load
