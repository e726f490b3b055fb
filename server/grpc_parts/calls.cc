#include "server/grpc_parts/calls.h"

#include <algorithm>
#include <array>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <utility>

#include "server/grpc_parts/unread.h"

namespace stellate::server {
namespace {

using Key = const void*;

// The calls of connections that are counted.
class Streams {
 public:
  void Begin(Key key, std::shared_ptr<ConnectionUnread> connection) {
    Part& part = PartOf(key);
    const std::lock_guard lock(part.mutex);
    Stream& stream = part.streams[key];
    stream.account = &connection->strangers;
    stream.connection = std::move(connection);
    Count(&stream, kCallBytes);
  }

  // Null: the call is not counted.
  std::shared_ptr<UnreadRules> RulesOf(Key key) {
    Part& part = PartOf(key);
    const std::lock_guard lock(part.mutex);
    const auto found = part.streams.find(key);
    return found == part.streams.end() ? nullptr : found->second.connection->rules;
  }

  void Judge(Key key, CallKind kind) {
    Part& part = PartOf(key);
    const std::lock_guard lock(part.mutex);
    const auto found = part.streams.find(key);
    if (found == part.streams.end()) return;
    Stream& stream = found->second;
    stream.kind = kind;
    if (kind != CallKind::kOwners) return;
    const std::int64_t bytes = stream.bytes;
    Count(&stream, -bytes);
    stream.account = &stream.connection->owners;
    Count(&stream, bytes);
  }

  WhatToDo Add(Key key, std::int64_t bytes) {
    Part& part = PartOf(key);
    const std::lock_guard lock(part.mutex);
    const auto found = part.streams.find(key);
    if (found == part.streams.end()) return WhatToDo::kTake;
    Stream& stream = found->second;
    const bool refused = stream.kind == CallKind::kRefused;
    if (refused && stream.bytes + bytes > kCallBytes + kSparedBytes) {
      const UnreadOfAll& all = stream.account->all;
      const bool storm = all.bytes > all.most / 4;
      const bool much = (stream.connection->let_go += bytes) > kLetGoBytes;
      return storm || much ? WhatToDo::kTooMuch : WhatToDo::kLetGo;
    }
    Count(&stream, bytes);
    const bool large = stream.bytes > kCallBytes + kSmallBytes;
    if (stream.kind == CallKind::kSmall && large) return WhatToDo::kTooMuch;
    const UnreadOfAll& all = stream.account->all;
    const double over = static_cast<double>(all.bytes - all.most) / static_cast<double>(all.most);
    const double spared = (1 - 2 * over) * static_cast<double>(all.most_of_one);
    const bool fits = over <= 0 || static_cast<double>(stream.account->bytes) <=
                                       std::max<double>(spared, 4 * kCallBytes);
    if (!fits) return WhatToDo::kTooMuch;
    return refused ? WhatToDo::kCopy : WhatToDo::kTake;
  }

  void Take(Key key, std::int64_t bytes) {
    Part& part = PartOf(key);
    const std::lock_guard lock(part.mutex);
    const auto found = part.streams.find(key);
    if (found == part.streams.end()) return;
    Stream& stream = found->second;
    Count(&stream, -bytes - (stream.is_new ? kCallBytes : 0));
    stream.is_new = false;
    ++stream.account->whole;
  }

  void End(Key key) {
    Part& part = PartOf(key);
    const std::lock_guard lock(part.mutex);
    const auto found = part.streams.find(key);
    if (found == part.streams.end()) return;
    Count(&found->second, -found->second.bytes);
    part.streams.erase(found);
  }

 private:
  struct Stream {
    std::shared_ptr<ConnectionUnread> connection;
    Unread* account = nullptr;  // of the connection
    CallKind kind = CallKind::kAnybodys;
    std::int64_t bytes = 0;  // its share
    bool is_new = true;      // its first message was not taken yet
  };
  struct Part {  // connections read at the same time
    std::mutex mutex;
    std::unordered_map<Key, Stream> streams;
  };

  static void Count(Stream* stream, std::int64_t bytes) {
    stream->bytes += bytes;
    stream->account->bytes += bytes;
    stream->account->all.bytes += bytes;
  }

  Part& PartOf(Key key) { return parts_[std::hash<Key>()(key) / 64 % parts_.size()]; }

  std::array<Part, 16> parts_;
};

// Outlives every connection.
Streams& AllStreams() {
  static auto& streams = *new Streams;
  return streams;
}

}  // namespace

bool CallBegins(const void* call, int fd) {
  auto unread = UnreadOf(fd);
  if (unread == nullptr) return false;
  AllStreams().Begin(call, std::move(unread));
  return true;
}

void CallEnds(const void* call) { AllStreams().End(call); }

void HeadersHaveCome(const void* call, std::string_view path, std::string_view authorization) {
  const auto rules = AllStreams().RulesOf(call);
  if (rules != nullptr) AllStreams().Judge(call, rules->judge(path, authorization));
}

WhatToDo PartComes(const void* call, std::int64_t bytes) { return AllStreams().Add(call, bytes); }

void RequestLeaves(const void* call, std::int64_t bytes) { AllStreams().Take(call, bytes); }

}  // namespace stellate::server
