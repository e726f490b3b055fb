// stellated: flags, logging, signals; the rest is Server.

#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <memory>
#include <system_error>
#include <utility>

#include "core/base/message.h"
#include "server/base/allocator.h"
#include "server/base/library_log.h"
#include "server/base/log.h"
#include "server/base/threads.h"
#include "server/base/version.h"
#include "server/config/flags.h"
#include "server/config/listen_address.h"
#include "server/net/health_check.h"
#include "server/net/tls.h"
#include "server/postgres/database.h"
#include "server/salvage/copy.h"
#include "server/salvage/salvage.h"
#include "server/server.h"

namespace {

using namespace stellate::server;  // NOLINT: this file is the program

constexpr int kExitUsage = 2;
constexpr auto kHealthLimit = std::chrono::seconds(5);

// SIGHUP has something to say only where there are files to read again; elsewhere it ends the
// process.
sigset_t Signals(const Flags& flags) {
  const Config& config = flags.config;
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  if (!flags.config_file.empty() || !config.token_file.empty() || !config.tls_certificate.empty()) {
    sigaddset(&signals, SIGHUP);
  }
  return signals;
}

// The signal that came within `milliseconds`, or 0.
int WaitForSignal(const sigset_t& signals, int milliseconds) {
  const timespec limit{milliseconds / 1000, milliseconds % 1000 * 1'000'000L};
  const int signal = sigtimedwait(&signals, nullptr, &limit);
  return signal > 0 ? signal : 0;
}

int Fail(const std::string& message, int status) {
  std::fprintf(stderr, "stellated: %s\n", message.c_str());
  return status;
}

int RunHealthCheck(const Flags& flags) {
  Config config = flags.config;
  if (!flags.health_certificate.empty() && !config.tls_certificate.empty()) {
    config.tls_certificate = flags.health_certificate;
    config.tls_key = flags.health_key;
  }
  const auto address = ParseListenAddress(config.listen);
  if (!address) return Fail(address.error().message, kExitUsage);
  const std::string trouble = CheckHealth(address->Target(), kHealthLimit,
                                          SelfCheckCredentials(config), flags.health_service);
  return trouble.empty() ? 0 : Fail(trouble, 1);
}

int RunOnDataDir(const Flags& flags) {
  const std::string& path = flags.config.data_dir;
  if (path.empty()) return Fail("--data-dir is not set: name the directory to look at", kExitUsage);
  const auto found = flags.salvage ? SalvageDataDir(path) : VerifyDataDir(path);
  if (!found) return Fail(found.error().message, 1);
  std::fputs(found->c_str(), stdout);
  return 0;
}

int RunCopy(const Flags& flags) {
  StartLogging(flags.config.log_level, flags.config.log_format);
  const auto open = [&flags](const std::string& setting) {
    const std::chrono::duration<double> patience(flags.config.database_patience_seconds);
    return OpenDatabase(
        {setting, 0, std::chrono::duration_cast<Clock::duration>(patience), {}, /*alone=*/true},
        [] { return false; });
  };
  const auto done = CopyMeshes(flags.copy_meshes[0], flags.copy_meshes[1], open);
  if (!done) return Fail(done.error().message, 1);
  std::fputs(done->c_str(), stdout);
  return 0;
}

// Written under another name and then renamed, so that whoever sees the file sees all of it.
bool WriteReadyFile(const std::string& path, const std::string& address) {
  const std::string draft = path + ".new";
  std::ofstream file(draft);
  file << address << "\n";
  file.close();
  return file.good() && std::rename(draft.c_str(), path.c_str()) == 0;
}

stellate::core::Expected<std::unique_ptr<Server>> StartServer(const Flags& flags, pid_t parent,
                                                              const sigset_t& signals,
                                                              bool* told_to_reload) {
  auto threads = CheckThreads(LeastThreads());
  if (!threads.ok()) return tl::unexpected(std::move(threads));
  try {
    return Server::Start(flags.config, stellate::core::Mesher::Create, [&] {
      if (flags.exit_with_parent && getppid() != parent) return true;
      const int signal = WaitForSignal(signals, 0);
      if (signal == SIGHUP) *told_to_reload = true;
      return signal != 0 && signal != SIGHUP;
    });
  } catch (const std::system_error& error) {  // each recorded mesh that goes on needs a thread
    return stellate::core::Refuse(
        stellate::core::StatusCode::kFailedPrecondition,
        stellate::core::Message("the system refuses a thread or a file: ", error.what(),
                                ": raise the limits of this process (ulimit -u, ulimit -n, the "
                                "pids of its control group)"));
  }
}

// A file that cannot be used leaves all as it is.
void Reload(Server* server, const Flags& flags, int argc, const char* const* argv) {
  server->ReloadFiles();
  if (flags.config_file.empty()) return;
  const auto next = ReadSettingsAgain(argc, argv);
  const stellate::core::Status status = next ? server->Reload(*next) : next.error();
  if (!status.ok()) {
    Log(LogLevel::kError, {},
        stellate::core::Message("all settings stay as they were: ", flags.config_file, ": ",
                                status.message));
    return;
  }
  SetLogLevel(server->config()->log_level);
  Log(LogLevel::kInfo, {}, "read " + flags.config_file + " again");
}

// Returns when it is time to stop. kAtOnce: nobody is left to wait for.
enum class Why { kTold, kAtOnce };
Why ServeUntilTold(const sigset_t& signals, bool with_parent, pid_t parent,
                   const std::function<void()>& reload) {
  while (true) {
    const int signal = WaitForSignal(signals, 250);
    if (signal == SIGHUP) {
      reload();
    } else if (signal != 0) {
      Log(LogLevel::kInfo, {}, "stopping", stellate::server::LogFields().Add("signal", signal));
      return Why::kTold;
    }
    // Polled, as PR_SET_PDEATHSIG would fire when the parent's *thread* ends.
    if (with_parent && getppid() != parent) {
      Log(LogLevel::kInfo, {}, "the parent process is gone: stopping");
      return Why::kAtOnce;
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const pid_t parent = getppid();
  const auto [flags, exit_status] = ParseFlags(argc, argv);
  if (exit_status) return *exit_status;
  const Config& config = flags.config;
  if (flags.health_check) return RunHealthCheck(flags);
  if (flags.verify_data_dir || flags.salvage) return RunOnDataDir(flags);
  if (!flags.copy_meshes.empty()) return RunCopy(flags);

  stellate::server::GiveBackLargeBlocks();
  // Before gRPC starts its threads, which inherit the mask: then sigtimedwait alone sees them.
  const sigset_t signals = Signals(flags);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  signal(SIGPIPE, SIG_IGN);
  StartLogging(config.log_level, config.log_format);
  stellate::server::TakeLibraryLogs();

  bool reload_is_due = false;
  auto server = StartServer(flags, parent, signals, &reload_is_due);
  if (!server && server.error().code == stellate::core::StatusCode::kCancelled) return 0;
  if (!server) return Fail(server.error().message, kExitUsage);
  const std::string& address = (*server)->address();
  std::printf("stellated listening on %s\n", address.c_str());
  std::fflush(stdout);
  Log(LogLevel::kInfo, {}, "listening",
      stellate::server::LogFields().Add("version", Version()).Add("address", address));
  if (!config.ready_file.empty() && !WriteReadyFile(config.ready_file, address)) {
    return Fail("cannot write --ready-file " + config.ready_file, 1);
  }

  const auto reload = [&, &flags = flags] { Reload(server->get(), flags, argc, argv); };
  if (reload_is_due) reload();
  const Why why = ServeUntilTold(signals, flags.exit_with_parent, parent, reload);
  const std::chrono::duration<double> drain(why == Why::kTold ? (*server)->config()->drain_seconds
                                                              : 0);
  const bool clean = (*server)->Stop(std::chrono::duration_cast<Clock::duration>(drain), [&] {
    const int signal = WaitForSignal(signals, 0);
    return signal != 0 && signal != SIGHUP;
  });
  if (!config.ready_file.empty()) unlink(config.ready_file.c_str());
  Log(LogLevel::kInfo, {}, "stopped");
  // A mesher in the middle of a round cannot be asked to leave: the process takes it along.
  if (!clean) std::_Exit(0);
  return 0;
}
