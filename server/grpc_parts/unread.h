#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

namespace stellate::server {

// What clients have begun to say and gRPC keeps in memory. A message is taken from the connection
// as it comes and reaches the server when it is whole: a stranger who leaves out the last byte of
// 300 messages of 4 MB has 1.2 GB kept, with no token asked for. gRPC's own ResourceQuota does not
// help: asked for 64 MB, version 1.51 held 1 to 2 GB, and ended honest calls and connections.
// Here it is counted, by functions of gRPC 1.51 that are replaced as header_bound.h says. The
// connection guard closes connections before all of them hold `most`. Where they come to hold more
// before it has looked, the one that adds to it is closed: unless it holds less than `most_of_one`,
// and the less of that the more all hold, down to a few calls at one and a half times `most`.
struct UnreadOfAll {
  const std::int64_t most = 0;
  const std::int64_t most_of_one = 0;
  std::atomic<std::int64_t> bytes{0};
};
struct Unread {
  const std::shared_ptr<UnreadOfAll> all;
  // Of the connection's calls that wait for their first message, kCallBytes each, and of messages
  // that are not whole or that nobody has asked for.
  std::atomic<std::int64_t> bytes{0};
  std::atomic<std::uint64_t> whole{0};  // messages that were taken, ever
};

inline constexpr std::int64_t kCallBytes = 16 << 10;  // as measured, 10 to 20 kB

// Counts for the connection, from before gRPC gets it.
std::shared_ptr<Unread> CountUnread(int fd, std::shared_ptr<UnreadOfAll> all);

// False: it cannot be counted with this gRPC and the way the program was built.
bool CountsUnread();

}  // namespace stellate::server
