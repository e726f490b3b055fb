#include "server/grpc_parts/header_bound.h"

#include <grpcpp/grpcpp.h>

#include <array>
#include <atomic>
#include <charconv>

namespace stellate::server {
namespace {

std::atomic<std::uint64_t> endless{0};

}  // namespace

std::uint64_t EndlessHeaderBlocks() { return endless; }

bool LacksHeaderBound(std::string_view version) {
  std::array<int, 3> parts{};
  const char* at = version.data();
  const char* const end = at + version.size();
  for (int& part : parts) {
    at = std::from_chars(at, end, part).ptr;
    if (at != end) ++at;  // the dot
  }
  const auto [major, minor, patch] = parts;
  if (major != 1 || minor > 56) return major < 1;
  if (minor < 53) return true;
  return patch < (minor == 54 ? 3 : 2);
}

}  // namespace stellate::server

#ifndef STELLATE_REPLACES_GRPC_PARTS

bool stellate::server::HeaderBlocksEnd() { return !LacksHeaderBound(grpc::Version()); }

#else

#include <absl/status/status.h>
#include <grpc/slice.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <unordered_map>

#include "server/grpc_parts/replaced.h"
#include "server/grpc_parts/unread.h"

struct grpc_metadata_batch;

namespace grpc_core {

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

namespace {

using stellate::server::kMostHeaderBytes;
using stellate::server::kMostHeaderFrames;
using stellate::server::kMostMetadataBytes;
using stellate::server::Original;

constexpr char kDestroy[] = "_ZN9grpc_core11HPackParserD1Ev";
constexpr char kBeginFrame[] =
    "_ZN9grpc_core11HPackParser10BeginFrameEP19grpc_metadata_batchjNS0_8BoundaryENS0_"
    "8PriorityENS0_7LogInfoE";
constexpr char kParse[] = "_ZN9grpc_core11HPackParser5ParseERK10grpc_sliceb";

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
  void Begin(const HPackParser* parser, bool ends, grpc_metadata_batch* metadata) {
    const void* const call = stellate::server::TakeCallBegun();
    const std::lock_guard lock(mutex_);
    Block& block = blocks_[parser];
    ++block.frames;
    block.ends = ends;
    if (call == nullptr) return;
    block.call = call;
    block.metadata = metadata;
  }

  // False: it is too long. `whole`: the block, if this ends it.
  bool Add(const HPackParser* parser, std::size_t bytes, bool frame_ends,
           std::optional<Block>* whole) {
    const std::lock_guard lock(mutex_);
    const auto found = blocks_.find(parser);
    if (found == blocks_.end()) return true;  // of a client of this process
    Block& block = found->second;
    block.bytes += bytes;
    if (block.bytes > kMostHeaderBytes || block.frames > kMostHeaderFrames) return false;
    if (!frame_ends || !block.ends) return true;
    *whole = block;
    blocks_.erase(found);
    return true;
  }

  void Forget(const HPackParser* parser) {
    const std::lock_guard lock(mutex_);
    blocks_.erase(parser);
  }

 private:
  std::mutex mutex_;
  std::unordered_map<const HPackParser*, Block> blocks_;
};

// Outlives every connection.
Blocks& OpenBlocks() {
  static auto& blocks = *new Blocks;
  return blocks;
}

}  // namespace

HPackParser::~HPackParser() {
  static auto* const destroy = Original<void(HPackParser*)>(kDestroy);
  OpenBlocks().Forget(this);
  destroy(this);
}

void HPackParser::BeginFrame(grpc_metadata_batch* metadata, std::uint32_t metadata_size_limit,
                             Boundary boundary, Priority priority, LogInfo log_info) {
  static auto* const begin = Original<void(HPackParser*, grpc_metadata_batch*, std::uint32_t,
                                           Boundary, Priority, LogInfo)>(kBeginFrame);
  if (!log_info.is_client) {
    OpenBlocks().Begin(this, boundary != Boundary::None, metadata);
    metadata_size_limit = std::min(metadata_size_limit, kMostMetadataBytes);
  }
  begin(this, metadata, metadata_size_limit, boundary, priority, log_info);
}

absl::Status HPackParser::Parse(const grpc_slice& slice, bool is_last) {
  static auto* const parse = Original<absl::Status(HPackParser*, const grpc_slice&, bool)>(kParse);
  std::optional<Block> whole;
  if (!OpenBlocks().Add(this, GRPC_SLICE_LENGTH(slice), is_last, &whole)) {
    ++stellate::server::endless;
    return absl::ResourceExhaustedError("a header block is too long");
  }
  // Headers are kept as long as their call, each as a part of the slice that it came in: with all
  // that was read from the connection at the time, unless they are copied.
  const grpc_slice copy = grpc_slice_copy(slice);
  auto status = parse(this, copy, is_last);
  grpc_slice_unref(copy);
  if (status.ok() && whole && whole->call != nullptr) {
    stellate::server::HeadersHaveCome(whole->call, whole->metadata);
  }
  return status;
}

}  // namespace grpc_core

bool stellate::server::HeaderBlocksEnd() {
  return IsReplaced(grpc_core::kDestroy) && IsReplaced(grpc_core::kBeginFrame) &&
         IsReplaced(grpc_core::kParse);
}

#endif
