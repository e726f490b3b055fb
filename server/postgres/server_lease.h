#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "core/status.h"
#include "server/base/clock.h"
#include "server/postgres/connection.h"
#include "server/storage/records.h"

namespace stellate::server {

// How long a server may be silent before others take its meshes: what a takeover waits for.
inline constexpr auto kLease = std::chrono::seconds(5);
inline constexpr auto kBeat = std::chrono::seconds(1);

// A server's row in the database that several share. Each beats there, and watches the beats of the
// others: whose row has not changed for a whole lease, while the database answered all the time, is
// gone, and its row is deleted, if it still is as it was seen. No clock but each one's own counts,
// and a database that was away moves nothing. Any server may take up meshes whose server has no
// row.
class ServerLease {
 public:
  struct Options {
    Clock::duration patience{};           // with a database that does not answer yet
    std::function<void(bool)> on_answer;  // whether it does, while this waits; may be empty
    bool alone = false;                   // waits until no other server is there
  };
  // Waits until the database answers. kFailedPrecondition: it does not within the patience, refuses
  // this server, or another version of stellated recorded meshes in it; kCancelled: `give_up` said
  // so.
  static core::Expected<std::unique_ptr<ServerLease>> Take(const std::string& url,
                                                           const Options& options,
                                                           const std::function<bool()>& give_up);
  // Lets others have its meshes immediately, unless the database is away.
  ~ServerLease();

  std::int64_t number() const { return number_; }
  // How often this server has beaten, as its row says.
  std::int64_t beat() const { return beat_; }
  const std::string& secret() const { return secret_; }
  std::string address() const;
  void Announce(const std::string& address);
  std::vector<Peer> Peers() const;

  // Others have found this server silent: it needs another row, which Renew notes. Any thread.
  bool IsLost() const { return lost_; }
  void Renew(std::int64_t number);
  // There are meshes whose servers are gone. Any thread.
  bool AreOrphansThere() const { return orphans_; }
  // Its last beats were taken. Any thread.
  bool IsAnswered() const;

 private:
  struct Sight {
    std::int64_t beats = 0;
    TimePoint since;  // when they were first seen so
    std::string address;
  };

  ServerLease(std::string url, std::unique_ptr<Connection> connection, std::string secret,
              std::int64_t number);
  void Run(const std::stop_token& stop);
  bool Beat();
  bool Look();
  bool DeclareSilentGone(TimePoint now);

  const std::string url_, secret_;
  std::unique_ptr<Connection> connection_;  // null: broken
  std::atomic<std::int64_t> number_, beat_{0};
  std::atomic<bool> lost_{false}, orphans_{false}, stopping_{false};
  std::atomic<bool> has_news_{false};               // for the others, with the next beat
  std::atomic<TimePoint> last_beat_{Clock::now()};  // that was taken

  mutable std::mutex mutex_;
  std::string address_;
  std::map<std::int64_t, Sight> servers_;  // as last seen, this one too

  TimePoint last_look_;  // for the thread alone
  std::jthread beating_;
};

}  // namespace stellate::server
