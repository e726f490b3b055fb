#include "server/net/channel_arguments.h"

#include <grpcpp/grpcpp.h>
#include <grpcpp/resource_quota.h>

#include "server/grpc_parts/header_bound.h"
#include "server/grpc_parts/unread.h"

namespace stellate::server {
namespace {

constexpr int kReadBytes = 64 << 10;
constexpr int kMaxSyncThreads = 64;  // reflection alone uses them

int Milliseconds(double seconds) { return static_cast<int>(seconds * 1000); }

}  // namespace

void SetChannelArguments(const Config& config, grpc::ServerBuilder* builder) {
  const int size = static_cast<int>(config.max_message_bytes);
  builder->SetMaxReceiveMessageSize(size);
  builder->SetMaxSendMessageSize(size);
  // gRPC inflates a message before it measures it: 4 MB of zeros, packed, would take gigabytes.
  for (const auto algorithm : {GRPC_COMPRESS_DEFLATE, GRPC_COMPRESS_GZIP}) {
    builder->SetCompressionAlgorithmSupportStatus(algorithm, false);
  }
  // A frozen client is found by pings; clients may ping as often as they like.
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, Milliseconds(config.keepalive_seconds));
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS,
                              Milliseconds(config.keepalive_timeout_seconds));
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MAX_PING_STRIKES, 0);
  builder->AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS,
                              Milliseconds(config.hello_seconds));
  builder->AddChannelArgument(GRPC_ARG_ENABLE_CHANNELZ, 1);  // the connection guard asks it
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS,
                              static_cast<int>(config.max_connection_streams));
  builder->AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, static_cast<int>(kMostMetadataBytes));
  // What is read at once is kept until the last of it was used: 4 MB, unless it is said.
  builder->AddChannelArgument(GRPC_ARG_TCP_MAX_READ_CHUNK_SIZE, kReadBytes);
  grpc::ResourceQuota quota("stellated");
  quota.SetMaxThreads(kMaxSyncThreads);
  // The worse way, as unread.h says.
  if (!CountsUnread()) quota.Resize(config.max_unread_bytes);
  builder->SetResourceQuota(quota);
}

}  // namespace stellate::server
