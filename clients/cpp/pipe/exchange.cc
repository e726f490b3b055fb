#include "pipe/exchange.h"

#include <poll.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <system_error>

#include "pipe/numbers.h"

namespace stellate::pipe {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kStopGrace = std::chrono::seconds(1);
constexpr size_t kReadBytes = 1 << 16;

// While it lives, writing to a pipe that nobody reads is an error of this thread and no signal.
class WithoutSigpipe {
 public:
  WithoutSigpipe() {
    sigset_t pending;
    sigpending(&pending);
    was_pending_ = sigismember(&pending, SIGPIPE) == 1;
    sigemptyset(&sigpipe_);
    sigaddset(&sigpipe_, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &sigpipe_, &before_);
  }
  ~WithoutSigpipe() {
    const timespec now{};
    if (!was_pending_) sigtimedwait(&sigpipe_, nullptr, &now);
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
  WithoutSigpipe(const WithoutSigpipe&) = delete;
  WithoutSigpipe& operator=(const WithoutSigpipe&) = delete;

 private:
  sigset_t sigpipe_, before_;
  bool was_pending_ = false;
};

class Conversation {
 public:
  Conversation(Process& process, std::string_view question,
               const std::function<bool(std::string*)>& take, const StopSignal& stop)
      : process_(process),
        unwritten_(question),
        asked_(question.size()),
        take_(take),
        stop_(stop) {}

  void Run(const Patience& patience) {
    if (!process_.unread.empty()) TooMuch();
    const auto silence = std::chrono::duration_cast<Clock::duration>(patience.silence);
    const auto unremarked = std::chrono::duration_cast<Clock::duration>(patience.unremarked);
    Clock::time_point moved = Clock::now();
    Clock::duration remark = patience.on_waiting ? unremarked : silence;
    while (!done_) {
      Wait(std::min(moved + std::min(silence, remark), stop_.deadline()));
      if (Move()) {
        moved = Clock::now();
        remark = patience.on_waiting ? unremarked : silence;
      }
      const Clock::time_point now = Clock::now();
      if (done_) break;
      if (now >= stop_.deadline()) throw std::runtime_error("it was asked to stop");
      if (now >= moved + silence) GiveUp(patience.silence.count());
      if (now < moved + remark) continue;
      patience.on_waiting(std::chrono::duration<double>(now - moved).count());
      remark *= 2;
    }
    if (!unwritten_.empty() || !process_.unread.empty()) TooMuch();
  }

 private:
  [[noreturn]] void GiveUp(double silence) const {
    char seconds[32];
    std::snprintf(seconds, sizeof seconds, "%g", silence);
    throw std::runtime_error("it has neither read nor written for " + std::string(seconds) +
                             " seconds" + Standing());
  }

  void Wait(Clock::time_point until) {
    const bool stopping = stop_.deadline() != Clock::time_point::max();
    fds_ = {pollfd{unwritten_.empty() ? -1 : process_.input.get(), POLLOUT, 0},
            pollfd{process_.output.get(), POLLIN, 0},
            pollfd{errors_open_ ? process_.errors.get() : -1, POLLIN, 0},
            pollfd{stopping ? -1 : stop_.descriptor(), POLLIN, 0}};
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
    constexpr std::int64_t kLongest = 1 << 30;  // milliseconds; it is looked at again then
    const int timeout = static_cast<int>(std::clamp<std::int64_t>(left, 0, kLongest));
    if (poll(fds_.data(), fds_.size(), timeout) < 0 && errno != EINTR) {
      throw std::system_error(errno, std::generic_category(), "poll");
    }
  }

  // Whether any byte went through.
  bool Move() {
    if (fds_[2].revents != 0) errors_open_ = process_.ReadErrors();
    // Read first: who closes its input may have answered all the same.
    const bool read = fds_[1].revents != 0 && Read();
    const bool written = !done_ && fds_[0].revents != 0 && Write();
    return read || written;
  }

  bool Read() {
    const ssize_t count = read(process_.output.get(), buffer_.data(), buffer_.size());
    if (count == 0) throw Ended("it closed its standard output" + Standing());
    if (count > 0) {
      process_.unread.append(buffer_.data(), static_cast<size_t>(count));
      done_ = take_(&process_.unread);
    } else if (errno != EAGAIN && errno != EINTR) {
      throw std::system_error(errno, std::generic_category(), "reading from it");
    }
    return count > 0;
  }

  bool Write() {
    const ssize_t count = write(process_.input.get(), unwritten_.data(), unwritten_.size());
    if (count > 0) unwritten_.remove_prefix(static_cast<size_t>(count));
    if (count < 0 && errno == EPIPE) throw Ended("it closed its standard input" + Standing());
    if (count < 0 && errno != EAGAIN && errno != EINTR) {
      throw std::system_error(errno, std::generic_category(), "writing to it");
    }
    return count > 0;
  }

  std::string Standing() const {
    if (asked_ == 0) return ", and its first line never came: is it written, and flushed?";
    return ", after it took " + std::to_string(asked_ - unwritten_.size()) + " of " +
           std::to_string(asked_) + " bytes";
  }

  [[noreturn]] void TooMuch() const {
    if (!unwritten_.empty())
      throw std::runtime_error("it answered before it was asked" + Standing());
    throw std::runtime_error("it wrote more than it was asked for: " + Quoted(process_.unread));
  }

  Process& process_;
  std::string_view unwritten_;
  const size_t asked_;  // bytes
  const std::function<bool(std::string*)>& take_;
  const StopSignal& stop_;
  std::array<pollfd, 4> fds_{};
  std::array<char, kReadBytes> buffer_;
  bool errors_open_ = true, done_ = false;
};

}  // namespace

StopSignal::StopSignal(std::stop_token stop)
    : event_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      deadline_(Clock::time_point::max()),
      callback_(std::move(stop), [this] { Raise(); }) {}

void StopSignal::Raise() {
  deadline_ = Clock::now() + kStopGrace;
  const std::uint64_t one = 1;
  if (write(event_.get(), &one, sizeof one) < 0) return;  // its next look at the deadline will do
}

void Exchange(Process& process, std::string_view question,
              const std::function<bool(std::string*)>& take, const Patience& patience,
              const StopSignal& stop) {
  const WithoutSigpipe quiet;
  Conversation(process, question, take, stop).Run(patience);
}

}  // namespace stellate::pipe
