// Each system call with which the journal changes the disk, from the first of an empty directory to
// the last of a finished mesh: failed once, or with a kill right before or right after it. The
// process never aborts, and the next one finds a journal that is sound, with the mesh finished as
// it would have been, or failed with a reason of the journal's, or going on to the same mesh.
//
// $STELLATE_CALL_STEP: every how manieth call (23); 1: all of them. $STELLATE_CALL_FIRST: the
// first, so that several processes share them out; else another for each fault.
// $STELLATE_CALL_KILLS: how many kills before each of these, and after it (1).

#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdio>
#include <iostream>
#include <map>

#include "server/base/log.h"
#include "server/records/record_bytes.h"
#include "server/salvage/salvage.h"
#include "tests/faults/fault_test.h"
#include "tests/server/support/journal_fixture.h"

namespace {

enum class Fault { kNone, kError, kFull, kShort, kKillBefore, kKillAfter };

// What happens at the `at`th call; of the process that is tried.
struct Plan {
  Fault fault = Fault::kNone;
  int at = 0;
  std::string directory;
};
Plan plan;                  // NOLINT: the functions below have no other place for it
std::atomic<int> calls{0};  // NOLINT

bool IsOurs(const char* path) {
  return !plan.directory.empty() && std::string_view(path).starts_with(plan.directory) &&
         std::string_view(path).size() > plan.directory.size();
}

bool IsOurs(int file) {
  char path[PATH_MAX] = {};
  const std::string link = "/proc/self/fd/" + std::to_string(file);
  const int error = errno;
  const bool known = readlink(link.c_str(), path, sizeof(path) - 1) > 0;
  errno = error;
  return known && IsOurs(path);
}

// Runs `call`, unless its turn is to fail; `short_call` does half of it.
template <typename Call, typename ShortCall>
auto Try(bool ours, Call call, ShortCall short_call) -> decltype(call()) {
  if (!ours || ++calls != plan.at) return call();
  switch (plan.fault) {
    case Fault::kError:
      errno = EIO;
      return -1;
    case Fault::kFull:
      errno = ENOSPC;
      return -1;
    case Fault::kShort:
      return short_call();
    case Fault::kKillBefore:
      kill(getpid(), SIGKILL);
      break;
    case Fault::kKillAfter:
      call();
      kill(getpid(), SIGKILL);
      break;
    case Fault::kNone:
      break;
  }
  return call();
}

template <typename Call>
auto Try(bool ours, Call call) -> decltype(call()) {
  return Try(ours, call, call);
}

template <typename Function>
Function* Real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

// In the place of the C library's, for SQLite too.
extern "C" {

ssize_t pwrite64(int file, const void* data, size_t bytes, off64_t at) {
  static auto* const real = Real<ssize_t(int, const void*, size_t, off64_t)>("pwrite64");
  return Try(
      IsOurs(file), [&] { return real(file, data, bytes, at); },
      [&] { return real(file, data, bytes / 2, at); });
}
ssize_t pwrite(int file, const void* data, size_t bytes, off_t at) {
  return pwrite64(file, data, bytes, at);
}
int fsync(int file) {
  static auto* const real = Real<int(int)>("fsync");
  return Try(IsOurs(file), [&] { return real(file); });
}
int fdatasync(int file) {
  static auto* const real = Real<int(int)>("fdatasync");
  return Try(IsOurs(file), [&] { return real(file); });
}
int ftruncate64(int file, off64_t size) noexcept {
  static auto* const real = Real<int(int, off64_t)>("ftruncate64");
  return Try(IsOurs(file), [&] { return real(file, size); });
}
int unlink(const char* path) noexcept {
  static auto* const real = Real<int(const char*)>("unlink");
  return Try(IsOurs(path), [&] { return real(path); });
}
int rename(const char* from, const char* to) noexcept {
  static auto* const real = Real<int(const char*, const char*)>("rename");
  return Try(IsOurs(to), [&] { return real(from, to); });
}

}  // extern "C"

namespace stellate::server {
namespace {

using testing::FakeWorker;
using testing::Outcome;
using testing::RecordedSphere;
using testing::RunMesh;

constexpr int kFine = 0, kRefused = 10, kWrong = 11;

class SystemCalls : public testing::JournalTest {
 protected:
  // Runs `child` in a process of its own, as this one must stay without threads. Its status.
  template <typename Child>
  static int Fork(Child child) {
    std::fflush(nullptr);
    const pid_t pid = fork();
    if (pid == 0) {
      StartLogging(LogLevel::kOff, LogFormat::kText);
      _exit(child());
    }
    int status = 0;
    waitpid(pid, &status, 0);
    return status;
  }

  static std::uint64_t DigestOfMesh(const Outcome& outcome) {
    RecordDigest digest;
    digest.Add(outcome.points.data(), outcome.points.size() * sizeof(double));
    digest.Add(outcome.simplices.data(), outcome.simplices.size() * sizeof(std::uint32_t));
    digest.Add(outcome.view.revision);
    return digest.value();
  }

  // A mesh, from an empty directory to its end. Tells how many calls that took.
  int Mesh(const Plan& wanted) {
    return Fork([&] {
      plan = wanted;
      plan.directory = directory_;
      {
        const auto journal = Journal::Open({directory_});
        if (!journal) return kRefused;
        RunMesh(RecordedSphere((*journal)->NewMesh()));
      }
      std::ofstream(directory_ + "/calls") << calls;
      return kFine;
    });
  }

  // What the next server makes of what is there.
  int Resume(std::uint64_t undisturbed) {
    return Fork([&] {
      {
        const auto journal = Journal::Open({directory_});
        if (!journal) {
          std::cout << journal.error().message << std::endl;
          return kRefused;
        }
        for (SessionOptions& options : (*journal)->TakeMeshes()) {
          const Outcome outcome = RunMesh(std::move(options));
          const bool failed = outcome.view.state == SessionState::kFailed &&
                              (outcome.view.failure.reason == FailureReason::kJournalFull ||
                               outcome.view.failure.reason == FailureReason::kJournalFailed);
          if (!failed && DigestOfMesh(outcome) != undisturbed) {
            std::cout << SessionStateName(outcome.view.state) << " " << outcome.view.failure.message
                      << std::endl;
            return kWrong;
          }
        }
      }
      return VerifyDataDir(directory_) ? kFine : kWrong;
    });
  }
};

TEST_F(SystemCalls, EachFailsOnce) {
  const int step = testing::FromEnvironment("STELLATE_CALL_STEP", 23);
  const int kills = testing::FromEnvironment("STELLATE_CALL_KILLS", 1);
  const int given_first = testing::FromEnvironment("STELLATE_CALL_FIRST", 0);
  ASSERT_EQ(Mesh({}), kFine);
  int count = 0;
  std::ifstream(directory_ + "/calls") >> count;
  ASSERT_GT(count, 50);
  std::uint64_t undisturbed = 0;
  Fork([&] {
    std::ofstream(directory_ + "/digest") << DigestOfMesh(RunMesh(RecordedSphere(nullptr)));
    return kFine;
  });
  std::ifstream(directory_ + "/digest") >> undisturbed;
  ASSERT_NE(undisturbed, 0u);
  const std::map<Fault, const char*> faults = {{Fault::kError, "an error"},
                                               {Fault::kFull, "a full disk"},
                                               {Fault::kShort, "half a write"},
                                               {Fault::kKillBefore, "a kill before"},
                                               {Fault::kKillAfter, "a kill after"}};
  for (const auto& [fault, name] : faults) {
    const bool kill = fault == Fault::kKillBefore || fault == Fault::kKillAfter;
    int tried = 0, refused = 0;
    // The order of threads moves the calls about; a few more than there were are tried.
    const int first = given_first > 0 ? given_first : 1 + static_cast<int>(fault) % step;
    for (int at = first; at <= count + 3; at += step) {
      for (int again = 0; again < (kill ? kills : 1); ++again) {
        std::filesystem::remove_all(directory_);
        const int status = Mesh({fault, at, {}});
        const bool killed = WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
        const bool exited =
            WIFEXITED(status) && (WEXITSTATUS(status) == kFine || WEXITSTATUS(status) == kRefused);
        EXPECT_TRUE(exited || killed) << name << " at call " << at << ": status " << status;
        refused += WIFEXITED(status) && WEXITSTATUS(status) == kRefused ? 1 : 0;
        EXPECT_EQ(Resume(undisturbed), kFine) << name << " at call " << at;
        if (HasFailure()) return;
      }
      ++tried;
    }
    std::cout << name << ": at " << tried << " of " << count << " calls, " << (kill ? kills : 1)
              << " times each; " << refused << " servers refused to start" << std::endl;
  }
}

}  // namespace
}  // namespace stellate::server
