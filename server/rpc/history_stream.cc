#include "server/rpc/history_stream.h"

#include "core/base/message.h"

namespace stellate::server {
namespace {

constexpr auto kHistoryWait = std::chrono::seconds(30);  // for memory

}  // namespace

grpc::Status TooManyWatchers(ServerState& state, const Session& session) {
  const std::size_t most = session.policy().max_watchers;
  return Refuse(state, {{"max-watchers", core::Message(most), "mesh"},
                        core::Message("the mesh has ", most,
                                      " watchers, the most that this server allows: end one "
                                      "first, or raise --max-watchers")});
}

std::optional<grpc::Status> NoHistory(ServerState& state, const Session& session,
                                      Clock::duration waited) {
  if (session.history().IsLost()) {
    return Refusal(v1::ERROR_REASON_INTERNAL,
                   "the server cannot read the mesh back from its record: see its log");
  }
  if (waited < kHistoryWait) return std::nullopt;
  return Refuse(state,
                {{"max-memory-bytes", core::Message(state.config()->max_memory_bytes), "server"},
                 "the mesh is on the server's disk, and it has no memory to read it back: "
                 "ask again when other meshes have ended, or raise --max-memory-bytes"});
}

}  // namespace stellate::server
