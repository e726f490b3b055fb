#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>
#include <utility>

namespace stellate::server {

// What clients have begun to say and gRPC keeps in memory. A message is taken from the connection
// as it comes and reaches the server when it is whole: a stranger who leaves out the last byte of
// 300 messages of 4 MB has 1.2 GB kept, with no token asked for. gRPC's own ResourceQuota does not
// help: asked for 64 MB, version 1.51 held 1 to 2 GB, and ended honest calls and connections.
// Here it is counted, by functions of gRPC 1.51 that are replaced as header_bound.h says, or by
// those that packaging/grpc/parts.patch has a later gRPC call. The connection guard closes
// connections before all of them hold `most`. Where they come to hold more before it has looked,
// the one that adds to it is closed: unless it holds less than `most_of_one`, and the less of that
// the more all hold, down to a few calls at one and a half times `most`.
struct UnreadOfAll {
  const std::int64_t most = 0;
  const std::int64_t most_of_one = 0;
  std::atomic<std::int64_t> bytes{0};
};

// What a call's headers say of the request that follows.
enum class CallKind {
  kAnybodys,  // to be read, as no tokens are asked for
  kOwners,    // to be read, with a token that is known
  kSmall,     // of a service that is open to all clients: beyond kSmallBytes, closes the connection
  // The call is refused whatever it says: what is beyond kSparedBytes is let go of as it comes. It
  // closes the connection beyond kLetGoBytes, or when strangers have a quarter of what they may
  // hold: gRPC reads ever larger pieces, up to 4 MB, from a connection that it can read fast.
  kRefused,
};
// Any thread, also a moment after the server has gone; takes the call's path and authorization.
using CallJudge = std::function<CallKind(std::string_view path, std::string_view authorization)>;

// Of a server. Owners have an account of their own, so that strangers take none of it.
struct UnreadRules {
  UnreadRules(CallJudge judge_in, std::int64_t most, std::int64_t most_of_one)
      : judge(std::move(judge_in)), strangers{most, most_of_one}, owners{most, most_of_one} {}
  const CallJudge judge;
  UnreadOfAll strangers, owners;
};
struct Unread {
  UnreadOfAll& all;
  // Of the connection's calls that wait for their first message, kCallBytes each, and of messages
  // that are incomplete or that no reader has asked for.
  std::atomic<std::int64_t> bytes{0};
  std::atomic<std::uint64_t> whole{0};  // messages that were taken, ever
};
struct ConnectionUnread {
  explicit ConnectionUnread(std::shared_ptr<UnreadRules> rules_in)
      : rules(std::move(rules_in)), strangers{rules->strangers}, owners{rules->owners} {}
  const std::shared_ptr<UnreadRules> rules;
  Unread strangers, owners;  // a call whose headers have not come is a stranger's
  std::atomic<std::int64_t> let_go{0};
};

inline constexpr std::int64_t kCallBytes = 16 << 10;  // as measured, 10 to 20 kB
inline constexpr std::int64_t kSmallBytes = 16 << 10;
inline constexpr std::int64_t kSparedBytes = 4 << 10;
inline constexpr std::int64_t kLetGoBytes = 64 << 10;  // of a connection, ever

// Counts for the connection, from before gRPC gets it.
std::shared_ptr<ConnectionUnread> CountUnread(int fd, std::shared_ptr<UnreadRules> rules);

// Null: it is not counted.
std::shared_ptr<ConnectionUnread> UnreadOf(int fd);

// False: it cannot be counted with this gRPC and the way the program was built.
bool CountsUnread();

}  // namespace stellate::server
