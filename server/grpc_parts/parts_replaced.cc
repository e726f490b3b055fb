// gRPC 1.51 as a shared library: some of its functions are replaced, by ones of the same names,
// which call them. header_bound.h and unread.h say what for.

#include <absl/status/status.h>
#include <absl/strings/string_view.h>
#include <absl/types/optional.h>
#include <absl/types/variant.h>
#include <grpc/slice.h>
#include <grpc/slice_buffer.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include "server/grpc_parts/calls.h"
#include "server/grpc_parts/header_bound.h"
#include "server/grpc_parts/replaced.h"
#include "server/grpc_parts/unread.h"

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

// As gRPC 1.51 declares it, where it is replaced. Its members are gRPC's.
class __attribute__((visibility("default"))) HPackParser {
 public:
  // NOLINTBEGIN(readability-identifier-naming)
  enum class Boundary : std::uint8_t { None, EndOfHeaders, EndOfStream };
  enum class Priority : std::uint8_t { None, Included };
  // NOLINTEND(readability-identifier-naming)
  struct LogInfo {
    std::uint32_t stream_id;
    enum Type : std::uint8_t { kHeaders, kTrailers, kDontKnow } type;
    bool is_client;
  };

  ~HPackParser();
  // Before each frame of a block.
  void BeginFrame(grpc_metadata_batch* metadata, std::uint32_t metadata_size_limit,
                  Boundary boundary, Priority priority, LogInfo log_info);
  // A part of the frame; an error closes the connection.
  absl::Status Parse(const grpc_slice& slice, bool is_last);
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

constexpr char kDestroy[] = "_ZN9grpc_core11HPackParserD1Ev";
constexpr char kBeginFrame[] =
    "_ZN9grpc_core11HPackParser10BeginFrameEP19grpc_metadata_batchjNS0_8BoundaryENS0_"
    "8PriorityENS0_7LogInfoE";
constexpr char kParseHeaders[] = "_ZN9grpc_core11HPackParser5ParseERK10grpc_sliceb";
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

// What has come of a block that has not ended.
struct Block {
  std::size_t bytes = 0;
  std::uint32_t frames = 0;
  bool ends = false;           // with the frame that is being read
  const void* call = nullptr;  // that it begins
  grpc_metadata_batch* metadata = nullptr;
};

class Blocks {
 public:
  void Begin(const grpc_core::HPackParser* parser, bool ends, const void* call,
             grpc_metadata_batch* metadata) {
    const std::lock_guard lock(mutex_);
    Block& block = blocks_[parser];
    ++block.frames;
    block.ends = ends;
    if (call == nullptr) return;
    block.call = call;
    block.metadata = metadata;
  }

  // False: it is too long. `whole`: the block, if this ends it.
  bool Add(const grpc_core::HPackParser* parser, std::size_t bytes, bool frame_ends,
           std::optional<Block>* whole) {
    const std::lock_guard lock(mutex_);
    const auto found = blocks_.find(parser);
    if (found == blocks_.end()) return true;  // of a client of this process
    Block& block = found->second;
    block.bytes += bytes;
    if (!HeaderBlockFits(block.bytes, block.frames)) return false;
    if (!frame_ends || !block.ends) return true;
    *whole = block;
    blocks_.erase(found);
    return true;
  }

  void Forget(const grpc_core::HPackParser* parser) {
    const std::lock_guard lock(mutex_);
    blocks_.erase(parser);
  }

 private:
  std::mutex mutex_;
  std::unordered_map<const grpc_core::HPackParser*, Block> blocks_;
};

// Outlives every connection.
Blocks& OpenBlocks() {
  static auto& blocks = *new Blocks;
  return blocks;
}

// Between the constructor of a call and its first header.
thread_local const void* call_begun = nullptr;

void TellOfHeaders(const Block& block) {
  const grpc_core::EvaluateArgs headers(block.metadata);
  const absl::string_view path = headers.GetPath();
  std::string joined;
  const absl::string_view authorization =
      headers.GetHeaderValue("authorization", &joined).value_or(absl::string_view());
  HeadersHaveCome(block.call, {path.data(), path.size()},
                  {authorization.data(), authorization.size()});
}

std::int64_t LengthOf(const grpc_core::SliceBuffer* buffer) {
  if (buffer == nullptr) return 0;
  return static_cast<std::int64_t>(reinterpret_cast<const grpc_slice_buffer*>(buffer)->length);
}

}  // namespace

bool HeaderBlocksEnd() {
  return IsReplaced(kDestroy) && IsReplaced(kBeginFrame) && IsReplaced(kParseHeaders);
}

bool CountsUnread() {
  return IsReplaced(kBegin) && IsReplaced(kEnd) && IsReplaced(kParse) && IsReplaced(kDeframe);
}

}  // namespace stellate::server

namespace server = stellate::server;

namespace grpc_core {

HPackParser::~HPackParser() {
  static auto* const destroy = server::Original<void(HPackParser*)>(server::kDestroy);
  server::OpenBlocks().Forget(this);
  destroy(this);
}

void HPackParser::BeginFrame(grpc_metadata_batch* metadata, std::uint32_t metadata_size_limit,
                             Boundary boundary, Priority priority, LogInfo log_info) {
  static auto* const begin =
      server::Original<void(HPackParser*, grpc_metadata_batch*, std::uint32_t, Boundary, Priority,
                            LogInfo)>(server::kBeginFrame);
  if (!log_info.is_client) {
    server::OpenBlocks().Begin(this, boundary != Boundary::None,
                               std::exchange(server::call_begun, nullptr), metadata);
    metadata_size_limit = std::min(metadata_size_limit, server::kMostMetadataBytes);
  }
  begin(this, metadata, metadata_size_limit, boundary, priority, log_info);
}

absl::Status HPackParser::Parse(const grpc_slice& slice, bool is_last) {
  static auto* const parse =
      server::Original<absl::Status(HPackParser*, const grpc_slice&, bool)>(server::kParseHeaders);
  std::optional<server::Block> whole;
  if (!server::OpenBlocks().Add(this, GRPC_SLICE_LENGTH(slice), is_last, &whole)) {
    return absl::ResourceExhaustedError("a header block is too long");
  }
  // Headers are kept as long as their call, each as a part of the slice that it came in: with all
  // that was read from the connection at the time, unless they are copied.
  const grpc_slice copy = grpc_slice_copy(slice);
  auto status = parse(this, copy, is_last);
  grpc_slice_unref(copy);
  if (status.ok() && whole && whole->call != nullptr) server::TellOfHeaders(*whole);
  return status;
}

}  // namespace grpc_core

grpc_chttp2_stream::grpc_chttp2_stream(grpc_chttp2_transport* transport,
                                       grpc_stream_refcount* refcount, const void* server_data,
                                       grpc_core::Arena* arena) {
  static auto* const begin =
      server::Original<void(grpc_chttp2_stream*, grpc_chttp2_transport*, grpc_stream_refcount*,
                            const void*, grpc_core::Arena*)>(server::kBegin);
  begin(this, transport, refcount, server_data, arena);
  if (server_data == nullptr) return;
  const int fd = grpc_endpoint_get_fd(
      grpc_transport_get_endpoint(reinterpret_cast<grpc_transport*>(transport)));
  if (server::CallBegins(this, fd)) server::call_begun = this;
}

grpc_chttp2_stream::~grpc_chttp2_stream() {
  static auto* const end = server::Original<void(grpc_chttp2_stream*)>(server::kEnd);
  server::CallEnds(this);
  end(this);
}

absl::Status grpc_chttp2_data_parser_parse(void* parser, grpc_chttp2_transport* transport,
                                           grpc_chttp2_stream* stream, const grpc_slice& slice,
                                           int is_last) {
  static auto* const parse = server::Original<absl::Status(
      void*, grpc_chttp2_transport*, grpc_chttp2_stream*, const grpc_slice&, int)>(server::kParse);
  const auto todo = server::PartComes(stream, static_cast<std::int64_t>(GRPC_SLICE_LENGTH(slice)));
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
    server::RequestLeaves(stream, server::LengthOf(out) - before + server::kPrefixBytes);
  }
  return result;
}
