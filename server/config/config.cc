#include "server/config/config.h"

#include <algorithm>

#include "core/base/message.h"
#include "server/config/collector_url.h"
#include "server/config/listen_address.h"
#include "server/config/settings.h"
#include "server/memory/machine.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;
using core::StatusCode;

Status Invalid(std::string message) { return {StatusCode::kInvalidArgument, std::move(message)}; }

// Who may listen in, and to whom the server talks.
Status ValidateSafety(const Config& config, const ListenAddress& address) {
  const bool tls = !config.tls_certificate.empty();
  if (tls != !config.tls_key.empty()) {
    return Invalid("--tls-cert and --tls-key go together: give both or neither");
  }
  if (!tls && !config.tls_client_ca.empty()) {
    return Invalid("--tls-client-ca needs TLS: give --tls-cert and --tls-key too");
  }
  if (!address.IsLoopback() && !tls) {
    if (!config.insecure_listen) {
      return Invalid(Message("--listen is \"", config.listen,
                             "\", which others can reach in plain text: give --tls-cert and "
                             "--tls-key, listen on 127.0.0.1 or a unix socket, or add "
                             "--insecure-listen where the network is trusted"));
    }
    if (!config.token_file.empty()) {
      return Invalid(Message("--token-file would have tokens sent to \"", config.listen,
                             "\" in plain text, for others to read and use: give --tls-cert and "
                             "--tls-key"));
    }
  }
  if (!config.traces_to.empty()) {
    const auto url = ParseCollectorUrl(config.traces_to);
    if (!url) return url.error();
  }
  if (config.metrics_listen.empty()) return Status::Ok();
  const auto metrics = ParseListenAddress(config.metrics_listen, "--metrics-listen");
  if (!metrics) return metrics.error();
  if (metrics->IsUnix()) return Invalid("--metrics-listen must be HOST:PORT or [IPV6]:PORT");
  return Status::Ok();
}

}  // namespace

Status Validate(const Config& config) {
  const auto address = ParseListenAddress(config.listen);
  if (!address) return address.error();
  Status safety = ValidateSafety(config, *address);
  if (!safety.ok()) return safety;
  if (!config.data_dir.empty() && !config.database.empty()) {
    return Invalid(
        "--data-dir and --database both say where meshes are recorded: give one of them");
  }
  if (!config.peer_address.empty()) {
    const auto peer = ParseListenAddress(config.peer_address, "--peer-address");
    if (!peer) return peer.error();
    if (config.database.empty()) {
      return Invalid("--peer-address is for servers that share a --database: give that too");
    }
  }
  return CheckRanges(config);
}

Config WithDefaults(Config config) {
  if (config.max_processors == 0) config.max_processors = MachineProcessors();
  if (config.max_memory_bytes == 0) config.max_memory_bytes = MachineBytes() / 4 * 3;
  if (config.owner_memory_bytes == 0) config.owner_memory_bytes = config.max_memory_bytes / 2;
  if (config.owner_meshes == 0) config.owner_meshes = config.max_meshes;
  return config;
}

std::size_t ChunkBytes(const Config& config) {
  return std::min(std::uint64_t{1} << 20, config.max_message_bytes / 2);
}

std::size_t PartBytes(const Config& config) {
  return std::min(std::size_t{1} << 17, ChunkBytes(config));
}

}  // namespace stellate::server
