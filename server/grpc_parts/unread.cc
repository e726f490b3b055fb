#include "server/grpc_parts/unread.h"

#include <mutex>
#include <unordered_map>
#include <utility>

namespace stellate::server {
namespace {

// Whose connection has a descriptor. The last to have it stays: descriptors are few.
class Connections {
 public:
  std::shared_ptr<ConnectionUnread> Add(int fd, std::shared_ptr<UnreadRules> rules) {
    auto unread = std::make_shared<ConnectionUnread>(std::move(rules));
    const std::lock_guard lock(mutex_);
    connections_[fd] = unread;
    return unread;
  }

  std::shared_ptr<ConnectionUnread> Find(int fd) {
    const std::lock_guard lock(mutex_);
    const auto found = connections_.find(fd);
    return found == connections_.end() ? nullptr : found->second;
  }

 private:
  std::mutex mutex_;
  std::unordered_map<int, std::shared_ptr<ConnectionUnread>> connections_;
};

// Outlives every connection.
Connections& AllConnections() {
  static auto& connections = *new Connections;
  return connections;
}

}  // namespace

std::shared_ptr<ConnectionUnread> CountUnread(int fd, std::shared_ptr<UnreadRules> rules) {
  return AllConnections().Add(fd, std::move(rules));
}

}  // namespace stellate::server

#ifndef STELLATE_REPLACES_GRPC_PARTS

bool stellate::server::CountsUnread() { return false; }
const void* stellate::server::TakeCallBegun() { return nullptr; }
void stellate::server::HeadersHaveCome(const void*, void*) {}

#else

#include <absl/status/status.h>
#include <absl/strings/string_view.h>
#include <absl/types/optional.h>
#include <absl/types/variant.h>
#include <grpc/slice_buffer.h>

#include <algorithm>
#include <array>
#include <string>

#include "server/grpc_parts/replaced.h"

struct grpc_chttp2_transport;
struct grpc_endpoint;
struct grpc_metadata_batch;
struct grpc_stream_refcount;
struct grpc_transport;

// gRPC's, as they are.
grpc_endpoint* grpc_transport_get_endpoint(grpc_transport* transport);
int grpc_endpoint_get_fd(grpc_endpoint* endpoint);

namespace grpc_core {
class Arena;
class SliceBuffer;  // a grpc_slice_buffer
struct Pending {};
template <typename T>
using Poll = absl::variant<Pending, T>;

// As gRPC 1.51 declares it: what a call's headers say.
class EvaluateArgs {
 public:
  explicit EvaluateArgs(grpc_metadata_batch* metadata) : metadata_(metadata) {}
  absl::string_view GetPath() const;
  // All values of that name, joined by commas if they are several, then kept in `joined`.
  absl::optional<absl::string_view> GetHeaderValue(absl::string_view name,
                                                   std::string* joined) const;

 private:
  [[maybe_unused]] grpc_metadata_batch* const metadata_;
  [[maybe_unused]] void* const connection_ = nullptr;
};
}  // namespace grpc_core

// As gRPC 1.51 declares it, where it is replaced: a call, as its connection sees it. The name is
// gRPC's.
// NOLINTNEXTLINE(readability-identifier-naming)
struct __attribute__((visibility("default"))) grpc_chttp2_stream {
  // `server_data`: set on the server's side.
  grpc_chttp2_stream(grpc_chttp2_transport* transport, grpc_stream_refcount* refcount,
                     const void* server_data, grpc_core::Arena* arena);
  ~grpc_chttp2_stream();
};

// A part of a message came; an error closes the connection.
__attribute__((visibility("default"))) absl::Status grpc_chttp2_data_parser_parse(
    void* parser, grpc_chttp2_transport* transport, grpc_chttp2_stream* stream,
    const grpc_slice& slice, int is_last);

// Takes a message out, if one is whole.
__attribute__((visibility("default"))) grpc_core::Poll<absl::Status>
grpc_deframe_unprocessed_incoming_frames(grpc_chttp2_stream* stream,
                                         std::int64_t* min_progress_size,
                                         grpc_core::SliceBuffer* out, std::uint32_t* flags);

namespace stellate::server {
namespace {

constexpr char kBegin[] =
    "_ZN18grpc_chttp2_streamC1EP21grpc_chttp2_transportP20grpc_stream_refcountPKvPN9grpc_"
    "core5ArenaE";
constexpr char kEnd[] = "_ZN18grpc_chttp2_streamD1Ev";
constexpr char kParse[] =
    "_Z29grpc_chttp2_data_parser_parsePvP21grpc_chttp2_transportP18grpc_chttp2_streamRK10grpc_"
    "slicei";
constexpr char kDeframe[] =
    "_Z40grpc_deframe_unprocessed_incoming_framesP18grpc_chttp2_streamPlPN9grpc_"
    "core11SliceBufferEPj";
constexpr std::int64_t kPrefixBytes = 5;  // before each message: its length

using Key = const grpc_chttp2_stream*;

// With a part of a message.
enum class WhatToDo { kTake, kCopy, kLetGo, kTooMuch };

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

// Between the constructor of a call and its first header.
thread_local Key call_begun = nullptr;

std::int64_t LengthOf(const grpc_core::SliceBuffer* buffer) {
  if (buffer == nullptr) return 0;
  return static_cast<std::int64_t>(reinterpret_cast<const grpc_slice_buffer*>(buffer)->length);
}

}  // namespace

bool CountsUnread() {
  return IsReplaced(kBegin) && IsReplaced(kEnd) && IsReplaced(kParse) && IsReplaced(kDeframe);
}

const void* TakeCallBegun() { return std::exchange(call_begun, nullptr); }

void HeadersHaveCome(const void* call, void* metadata) {
  const auto key = static_cast<Key>(call);
  const auto rules = AllStreams().RulesOf(key);
  if (rules == nullptr) return;
  const grpc_core::EvaluateArgs headers(static_cast<grpc_metadata_batch*>(metadata));
  const absl::string_view path = headers.GetPath();
  std::string joined;
  const absl::string_view authorization =
      headers.GetHeaderValue("authorization", &joined).value_or(absl::string_view());
  AllStreams().Judge(
      key, rules->judge({path.data(), path.size()}, {authorization.data(), authorization.size()}));
}

}  // namespace stellate::server

namespace server = stellate::server;

grpc_chttp2_stream::grpc_chttp2_stream(grpc_chttp2_transport* transport,
                                       grpc_stream_refcount* refcount, const void* server_data,
                                       grpc_core::Arena* arena) {
  static auto* const begin =
      server::Original<void(grpc_chttp2_stream*, grpc_chttp2_transport*, grpc_stream_refcount*,
                            const void*, grpc_core::Arena*)>(server::kBegin);
  begin(this, transport, refcount, server_data, arena);
  if (server_data == nullptr) return;
  auto unread = server::AllConnections().Find(grpc_endpoint_get_fd(
      grpc_transport_get_endpoint(reinterpret_cast<grpc_transport*>(transport))));
  if (unread == nullptr) return;
  server::AllStreams().Begin(this, std::move(unread));
  server::call_begun = this;
}

grpc_chttp2_stream::~grpc_chttp2_stream() {
  static auto* const end = server::Original<void(grpc_chttp2_stream*)>(server::kEnd);
  server::AllStreams().End(this);
  end(this);
}

absl::Status grpc_chttp2_data_parser_parse(void* parser, grpc_chttp2_transport* transport,
                                           grpc_chttp2_stream* stream, const grpc_slice& slice,
                                           int is_last) {
  static auto* const parse = server::Original<absl::Status(
      void*, grpc_chttp2_transport*, grpc_chttp2_stream*, const grpc_slice&, int)>(server::kParse);
  const auto todo =
      server::AllStreams().Add(stream, static_cast<std::int64_t>(GRPC_SLICE_LENGTH(slice)));
  switch (todo) {
    case server::WhatToDo::kTooMuch:
      return absl::ResourceExhaustedError("too many requests are not whole");
    case server::WhatToDo::kTake:
      return parse(parser, transport, stream, slice, is_last);
    case server::WhatToDo::kCopy:
    case server::WhatToDo::kLetGo:
      break;
  }
  // A slice keeps all that was read from the connection with it. An empty one may end the request.
  const grpc_slice kept =
      todo == server::WhatToDo::kCopy ? grpc_slice_copy(slice) : grpc_empty_slice();
  auto status = parse(parser, transport, stream, kept, is_last);
  grpc_slice_unref(kept);
  return status;
}

grpc_core::Poll<absl::Status> grpc_deframe_unprocessed_incoming_frames(
    grpc_chttp2_stream* stream, std::int64_t* min_progress_size, grpc_core::SliceBuffer* out,
    std::uint32_t* flags) {
  static auto* const deframe = server::Original<grpc_core::Poll<absl::Status>(
      grpc_chttp2_stream*, std::int64_t*, grpc_core::SliceBuffer*, std::uint32_t*)>(
      server::kDeframe);
  const std::int64_t before = server::LengthOf(out);
  auto result = deframe(stream, min_progress_size, out, flags);
  const auto* const status = absl::get_if<absl::Status>(&result);
  if (out != nullptr && status != nullptr && status->ok()) {
    server::AllStreams().Take(stream, server::LengthOf(out) - before + server::kPrefixBytes);
  }
  return result;
}

#endif
