#include "pipe/process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <thread>

namespace stellate::pipe {
namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

constexpr milliseconds kGrace{2000};      // between an end of input, SIGTERM and SIGKILL
constexpr milliseconds kLastWords{1000};  // from closed pipes to the end
constexpr size_t kKeptErrors = 4000;      // bytes; a server takes 4096 for a failure in all
constexpr int kShownLines = 10;
constexpr int kPipeBytes = 1 << 20;  // an unprivileged program's most; a wish

void Check(int error, const char* what) {
  if (error != 0) throw std::system_error(error, std::generic_category(), what);
}

// Not one of the standard streams' numbers, which may be free here and are given out in the child.
Descriptor Lifted(const Descriptor& end) {
  Descriptor lifted(fcntl(end.get(), F_DUPFD_CLOEXEC, STDERR_FILENO + 1));
  Check(lifted.get() < 0 ? errno : 0, "cannot make a pipe");
  return lifted;
}

struct Pipe {
  Pipe() {
    int ends[2];
    Check(pipe2(ends, O_CLOEXEC) != 0 ? errno : 0, "cannot make a pipe");
    const Descriptor first(ends[0]), second(ends[1]);
    read = Lifted(first);
    write = Lifted(second);
    fcntl(read.get(), F_SETPIPE_SZ, kPipeBytes);
  }
  Descriptor read, write;
};

void Unblock(const Descriptor& end) {
  Check(fcntl(end.get(), F_SETFL, O_NONBLOCK) != 0 ? errno : 0, "cannot set up a pipe");
}

// The child's view: three streams, a group of its own so that a terminal's Ctrl-C is ours to
// handle, no signal blocked or ignored.
pid_t Spawn(const std::string& command, const Pipe& input, const Pipe& output, const Pipe& errors) {
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  Check(posix_spawn_file_actions_init(&actions), "cannot start a process");
  Check(posix_spawnattr_init(&attributes), "cannot start a process");
  posix_spawn_file_actions_adddup2(&actions, input.read.get(), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output.write.get(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors.write.get(), STDERR_FILENO);
  sigset_t signals;
  sigemptyset(&signals);
  posix_spawnattr_setsigmask(&attributes, &signals);
  sigfillset(&signals);
  posix_spawnattr_setsigdefault(&attributes, &signals);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes,
                           POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  std::string shell = "/bin/sh", flag = "-c", line = command;
  char* const arguments[] = {shell.data(), flag.data(), line.data(), nullptr};
  pid_t pid = 0;
  const int error = posix_spawn(&pid, shell.c_str(), &actions, &attributes, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  Check(error, "cannot start /bin/sh");
  return pid;
}

// Reads all that is there. False at the end.
bool Drain(const Descriptor& from, std::string* to) {
  char buffer[4096];
  while (true) {
    const ssize_t count = read(from.get(), buffer, sizeof buffer);
    if (count > 0 && to != nullptr) to->append(buffer, static_cast<size_t>(count));
    if (count > 0 || (count < 0 && errno == EINTR)) continue;
    return count < 0 && errno == EAGAIN;
  }
}

}  // namespace

void Descriptor::Close() {
  if (number_ >= 0) close(number_);
  number_ = -1;
}

Process::Process(const std::string& command) {
  Pipe in, out, err;
  Unblock(in.write);
  Unblock(out.read);
  Unblock(err.read);
  pid_ = Spawn(command, in, out, err);
  input = std::move(in.write);
  output = std::move(out.read);
  errors = std::move(err.read);
}

Process::~Process() { End(Manner::kInOrder); }

bool Process::ReadErrors() {
  const bool more = Drain(errors, &last_errors_);
  if (last_errors_.size() > kKeptErrors) {
    last_errors_.erase(0, last_errors_.size() - kKeptErrors);
    last_errors_.replace(0, last_errors_.find('\n') + 1, "...\n");
  }
  return more;
}

std::string Process::LastErrors() const {
  std::string text = last_errors_;
  while (!text.empty() && text.back() == '\n') text.pop_back();
  if (text.empty()) return "";
  size_t begin = text.size();
  for (int line = 0; line < kShownLines && begin != std::string::npos && begin > 0; ++line) {
    begin = text.rfind('\n', begin - 1);
  }
  text = begin == std::string::npos || begin == 0 ? text : text.substr(begin + 1);
  return "\nits standard error ends:\n" + text;
}

// Whether it has come, within the time. The process stays a zombie, whose group's number is nobody
// else's.
bool Process::AwaitEnd(Whose whose, milliseconds patience) {
  const Clock::time_point deadline = Clock::now() + patience;
  while (true) {
    siginfo_t info{};
    const int waited = waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT);
    if (waited == 0 && info.si_pid == pid_) {
      ended_ = true;
      killed_ = info.si_code != CLD_EXITED;
      status_ = info.si_status;
    }
    // What it has to say may not fit into a pipe.
    const bool output_ended = whose == Whose::kAll && !Drain(output, nullptr);
    const bool errors_ended = !ReadErrors();
    if (ended_ && (whose == Whose::kItsOwn || (output_ended && errors_ended))) return true;
    if (Clock::now() >= deadline) return false;
    std::this_thread::sleep_for(milliseconds(2));
  }
}

void Process::End(Manner manner) {
  if (collected_) return;
  input.Close();
  if (manner == Manner::kNow || !AwaitEnd(Whose::kAll, kGrace)) {
    kill(-pid_, SIGTERM);
    AwaitEnd(Whose::kAll, kGrace);
  }
  kill(-pid_, SIGKILL);
  while (waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
  collected_ = true;
  output.Close();
  errors.Close();
}

std::string Process::HowItEnded() {
  if (!AwaitEnd(Whose::kItsOwn, kLastWords)) return "it is still there";
  if (killed_) {
    return "it was ended by signal " + std::to_string(status_) + " (" + strsignal(status_) + ")";
  }
  return "it ended with status " + std::to_string(status_) +
         (status_ == 127 ? ", which is the shell's for a command that is not found" : "");
}

}  // namespace stellate::pipe
