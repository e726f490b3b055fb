// gRPC that packaging/grpc/build made: parts.patch makes it report.

#include <grpc/parts_watch.h>

#include "server/grpc_parts/calls.h"
#include "server/grpc_parts/header_bound.h"
#include "server/grpc_parts/unread.h"

namespace stellate::server {
namespace {

grpc_parts_watch::part Part(const void* call, std::size_t bytes) {
  switch (PartComes(call, static_cast<std::int64_t>(bytes))) {
    case WhatToDo::kTake:
      return grpc_parts_watch::take;
    case WhatToDo::kCopy:
      return grpc_parts_watch::copy;
    case WhatToDo::kLetGo:
      return grpc_parts_watch::let_go;
    case WhatToDo::kTooMuch:
      break;
  }
  return grpc_parts_watch::close_connection;
}

// Before there is any server. gRPC reports nothing of clients in this process.
const bool watching = [] {
  grpc_watched_parts.call_begins = [](const void* call, int fd) { CallBegins(call, fd); };
  grpc_watched_parts.call_ends = CallEnds;
  grpc_watched_parts.headers_come = HeadersHaveCome;
  grpc_watched_parts.header_block_fits = HeaderBlockFits;
  grpc_watched_parts.part_comes = Part;
  grpc_watched_parts.request_leaves = [](const void* call, std::size_t bytes) {
    RequestLeaves(call, static_cast<std::int64_t>(bytes));
  };
  grpc_watched_parts.most_metadata_bytes = kMostMetadataBytes;
  return true;
}();

}  // namespace

bool HeaderBlocksEnd() { return watching; }
bool CountsUnread() { return watching; }

}  // namespace stellate::server
