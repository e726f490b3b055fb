#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "core/status.h"
#include "server/base/clock.h"
#include "server/postgres/connection.h"

namespace stellate::server {

// How long a server may be silent before another takes the database: what a takeover waits for.
inline constexpr auto kLease = std::chrono::seconds(5);
inline constexpr auto kBeat = std::chrono::seconds(1);

// One server at a time holds a database and writes to it. It beats each second; the others stand
// by, watch the beats, and one takes the database once it has seen none for a whole lease, while
// the database answered it all the time: no clock but its own counts, and a database that was away
// moves nothing. The holder's term is in each of its writes, which an ended term refuses
// (postgres_records.cc): a holder that was frozen, or cut off, changes nothing any more.
//
//   auto lease = DatabaseLease::Take(url, "host:port", [] { return is_stopping; });
//   ... WHERE term = (*lease)->term() ...
class DatabaseLease {
 public:
  struct Options {
    std::string name;                     // tells this server to those that stand by
    Clock::duration patience{};           // with a database that does not answer yet
    std::function<void(bool)> on_answer;  // whether it does, while this waits; may be empty
  };
  // Waits until the database answers, and then until no other server holds it, for ever if need be.
  // kFailedPrecondition: it does not answer within the patience, refuses this server, or another
  // version of stellated recorded meshes in it; kCancelled: `give_up` said so.
  static core::Expected<std::unique_ptr<DatabaseLease>> Take(const std::string& url,
                                                             const Options& options,
                                                             const std::function<bool()>& give_up);
  // Lets another server have it immediately, unless the database is away.
  ~DatabaseLease();

  std::int64_t term() const { return term_; }
  // Another server has taken it. Any thread.
  bool IsLost() const { return lost_; }
  void NoteLoss();
  // Its last beats were taken. Any thread.
  bool IsAnswered() const;

 private:
  DatabaseLease(std::string url, std::unique_ptr<Connection> connection, std::int64_t term);
  void Beat(const std::stop_token& stop);

  const std::string url_;
  std::unique_ptr<Connection> connection_;  // null: broken
  const std::int64_t term_;
  std::atomic<bool> lost_{false}, stopping_{false};
  std::atomic<TimePoint> last_beat_{Clock::now()};  // that was taken
  std::jthread beating_;
};

}  // namespace stellate::server
