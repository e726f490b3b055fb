#pragma once

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "server/grpc_parts/unread.h"
#include "server/net/channelz.h"

namespace stellate::server {

// Closes TCP connections that hold too many calls or unread bytes. gRPC 1.51 limits the calls open
// on a connection, but only once the client has acknowledged the limit; and it accepts new calls
// faster than it frees those that the client resets (CVE-2023-44487). Both cost 10 to 20 kB a call,
// without bound. Messages that never become complete: unread.h.
class ConnectionGuard {
 public:
  struct Limits {
    std::size_t calls = 0;  // of a connection, that gRPC has not freed
    // Of all connections, counted separately for owners' requests and others; the connections that
    // hold the most for the longest time are closed.
    std::int64_t unread_bytes = 0;
    std::int64_t request_bytes = 0;                // the largest request
    std::chrono::duration<double> request_time{};  // for a connection's next request to be complete
    // Connections at a time that have not said hello: the handshake of TLS is not over, or HTTP/2
    // has not begun. Half a handshake takes 100 kB. gRPC itself ends them after --hello-seconds.
    std::size_t hellos = 0;
  };

  // `port`: where the server listens. `judge`: unread.h. `closed` is called, on another thread,
  // for each connection that is closed, with the setting that closed it.
  ConnectionGuard(int port, const Limits& limits, CallJudge judge,
                  std::function<void(const char* setting)> closed);
  ~ConnectionGuard();

  // Call it for every connection, before gRPC has it. One thread at a time.
  void Watch(int fd);

  // Whether further connections should wait: closed ones have left many calls behind, or as many as
  // allowed have not said hello.
  bool IsBehind() const { return state_.behind || state_.silent_count >= limits_.hellos; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Holding {                 // of a connection's unread messages
    std::uint64_t whole = 0;       // complete messages, at the last count
    Clock::time_point moved = {};  // when one became complete, or nothing was unread
    Clock::time_point light = {};  // when it held little
  };
  struct Connection {
    Clock::time_point came = {};
    int fd = -1;
    ino_t number = 0;         // distinguishes it from another that got the same descriptor
    std::string peer;         // as gRPC writes it
    ConnectionId id = 0;      // 0: not known yet
    std::uint64_t bytes = 0;  // received, and
    std::size_t calls = 0;    // held, when it was last asked about
    bool ending = false;      // either side has closed it
    bool closed = false;      // by this guard
    std::shared_ptr<ConnectionUnread> unread;
    Holding of_strangers, of_owners;
  };

  void Run(const std::stop_token& stop);
  void Look();
  bool IsCalm(Connection* connection);
  void FindIds(const std::set<std::uint64_t>& keys);
  void BoundHellos();
  void Wake() const;
  void CountLeftBehind();
  void NothingWasUnread();
  static void NothingIsUnread(Holding* holding);
  void BoundUnread(Unread ConnectionUnread::*account, Holding Connection::*holding);
  void GiveBack();
  void Close(Connection* connection, const char* setting, const std::string& what,
             const std::string& allowed);
  void SayWhatWasClosed();

  const int port_;
  const Limits limits_;
  const std::shared_ptr<UnreadRules> unread_;
  const std::function<void(const char* setting)> closed_;
  const int epoll_;
  const int wake_;  // readable when the thread must stop, or a connection came

  std::mutex mutex_;  // of the connections
  std::uint64_t last_key_ = 0;
  std::unordered_map<std::uint64_t, Connection> connections_;
  std::set<std::uint64_t> silent_;  // not known to have said hello; the oldest first

  // For the thread alone:
  std::set<std::uint64_t> busy_;   // to be examined again
  bool hurried_ = false;           // much is unread
  Clock::time_point awake_until_;  // until then gRPC may have unread data
  // Connections that are gone.
  struct {
    std::vector<ConnectionId> ids;  // may have left calls behind
    std::size_t ending_calls = 0;   // of those that are closed and not gone yet
    std::size_t silent = 0;         // never said hello, since memory was given back
    std::size_t swept = 0;          // how many silent ones were left when all were last looked at
    Clock::time_point seen_silent;
  } gone_;
  // The next line of the log.
  struct {
    std::size_t count = 0;  // closed since the last line
    std::string last;       // the last of those, and why
    Clock::time_point time;
  } said_;
  struct {
    bool untidy = false;  // must be released once it is quiet
    Clock::time_point quiet_at;
    Clock::time_point given_back;
  } memory_;

  // For other threads, too.
  struct {
    std::atomic<bool> behind{false};
    std::atomic<std::size_t> silent_count{0};
    std::atomic<bool> napping{false};  // examines nothing until it is woken
  } state_;
  std::jthread thread_;
};

}  // namespace stellate::server
