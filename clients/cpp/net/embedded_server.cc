#include "net/embedded_server.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

namespace stellate::client {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr auto kReadyTime = std::chrono::seconds(30);
constexpr auto kStopTime = std::chrono::seconds(10);
constexpr const char* kReadyLine = "stellated listening on ";

bool IsProgram(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored) && access(path.c_str(), X_OK) == 0;
}

tl::unexpected<Error> Failed(const std::string& what) {
  return Fail(ErrorCode::kServerFailed, what);
}

constexpr size_t kLongestSocketPath = 100;  // the kernel takes 107 bytes

// For this user alone, in /tmp where $TMPDIR is none or too long for a socket; "" and errno if not.
std::string MakeDirectory() {
  const std::string name = "stellate-XXXXXX";
  std::error_code error;
  std::string pattern = (fs::temp_directory_path(error) / name).string();
  const bool fits = pattern.size() + std::strlen("/socket") <= kLongestSocketPath;
  if (!error && fits && mkdtemp(pattern.data()) != nullptr) return pattern;
  pattern = "/tmp/" + name;
  return mkdtemp(pattern.data()) == nullptr ? "" : pattern;
}

}  // namespace

Expected<std::string> FindServer() {
  if (const char* named = std::getenv("STELLATED"); named != nullptr && *named != '\0') {
    if (IsProgram(named)) return std::string(named);
    return Failed(std::string("$STELLATED is '") + named + "', which is not a program to run");
  }
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  if (!error && IsProgram(self.parent_path() / "stellated")) {
    return (self.parent_path() / "stellated").string();
  }
  if (const char* path = std::getenv("PATH"); path != nullptr) {
    std::istringstream directories(path);
    for (std::string directory; std::getline(directories, directory, ':');) {
      if (!directory.empty() && IsProgram(fs::path(directory) / "stellated")) {
        return (fs::path(directory) / "stellated").string();
      }
    }
  }
  return Failed(
      "no server was given and no stellated found to start: name a server, or set $STELLATED to "
      "the "
      "binary, or put it next to this program or on PATH");
}

Expected<std::unique_ptr<EmbeddedServer>> EmbeddedServer::Start() {
  const Expected<std::string> binary = FindServer();
  if (!binary) return tl::unexpected(binary.error());
  std::unique_ptr<EmbeddedServer> server(new EmbeddedServer);
  if (const auto ok = server->Launch(*binary); !ok) return tl::unexpected(ok.error());
  if (const auto ok = server->AwaitReady(); !ok) return tl::unexpected(ok.error());
  return server;
}

Expected<void> EmbeddedServer::Launch(const std::string& binary) {
  directory_ = MakeDirectory();
  if (directory_.empty()) {
    return Failed(std::string("cannot make a directory for the server's socket in /tmp: ") +
                  std::strerror(errno));
  }
  address_ = "unix:" + directory_ + "/socket";
  const std::string log = directory_ + "/log";
  int pipe_ends[2];
  if (pipe2(pipe_ends, O_CLOEXEC) != 0) {
    return Failed(std::string("cannot make a pipe: ") + std::strerror(errno));
  }
  const std::string listen = "--listen=" + address_;
  char* const arguments[] = {const_cast<char*>(binary.c_str()), const_cast<char*>(listen.c_str()),
                             nullptr};
  const pid_t parent = getpid();
  process_ = fork();
  if (process_ == 0) {
    // Only async-signal-safe calls from here to execv.
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(127);  // it died before the line above
    setpgid(0, 0);                        // a terminal's Ctrl-C is the client's to handle
    sigset_t none;
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, nullptr);
    const int log_file = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    if (log_file < 0 || dup2(log_file, STDERR_FILENO) < 0 ||
        dup2(pipe_ends[1], STDOUT_FILENO) < 0) {
      _exit(127);
    }
    execv(arguments[0], arguments);
    _exit(127);
  }
  close(pipe_ends[1]);
  output_ = pipe_ends[0];
  if (process_ < 0) return Failed(std::string("cannot start ") + binary);
  return {};
}

Expected<void> EmbeddedServer::AwaitReady() {
  const auto deadline = Clock::now() + kReadyTime;
  std::string printed;
  while (printed.find('\n') == std::string::npos) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
    pollfd ready{output_, POLLIN, 0};
    const int polled = left > 0 ? poll(&ready, 1, static_cast<int>(left)) : 0;
    if (polled < 0 && errno == EINTR) continue;
    if (polled <= 0) return Failed("stellated was started but did not get ready" + LogTail());
    char buffer[512];
    const ssize_t count = read(output_, buffer, sizeof buffer);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return Failed("stellated ended before it was ready" + LogTail());
    printed.append(buffer, static_cast<size_t>(count));
  }
  if (printed.rfind(kReadyLine, 0) != 0) {
    return Failed("stellated was started but says: " + printed.substr(0, printed.find('\n')));
  }
  drain_ = std::thread([output = output_] {
    char buffer[512];
    ssize_t count = 0;
    do {
      count = read(output, buffer, sizeof buffer);
    } while (count > 0 || (count < 0 && errno == EINTR));
  });
  return {};
}

bool EmbeddedServer::alive() const {
  siginfo_t ended{};  // left for the destructor to collect
  const int waited =
      waitid(P_PID, static_cast<id_t>(process_), &ended, WEXITED | WNOHANG | WNOWAIT);
  return waited == 0 && ended.si_pid == 0;
}

std::string EmbeddedServer::LogTail() const {
  std::ifstream file(directory_ + "/log");
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (text.empty()) return "";
  constexpr size_t kTail = 1000;
  return "; its log ends: " + text.substr(text.size() > kTail ? text.size() - kTail : 0);
}

EmbeddedServer::~EmbeddedServer() {
  if (process_ > 0) {
    kill(process_, SIGTERM);
    const auto deadline = Clock::now() + kStopTime;
    while (waitpid(process_, nullptr, WNOHANG) == 0) {
      if (Clock::now() > deadline) kill(process_, SIGKILL);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  if (drain_.joinable()) drain_.join();  // its end of the pipe is closed
  if (output_ >= 0) close(output_);
  std::error_code ignored;
  if (!directory_.empty()) fs::remove_all(directory_, ignored);
}

}  // namespace stellate::client
