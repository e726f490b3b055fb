#include "server/config/config.h"

#include <arpa/inet.h>

#include <algorithm>
#include <charconv>

#include "core/base/message.h"
#include "server/base/machine_memory.h"
#include "server/config/settings.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;
using core::StatusCode;

constexpr std::size_t kMaxUnixPath = 107;  // what sockaddr_un holds

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
  if (config.metrics_listen.empty()) return Status::Ok();
  const auto metrics = ParseListenAddress(config.metrics_listen, "--metrics-listen");
  if (!metrics) return metrics.error();
  if (metrics->IsUnix()) return Invalid("--metrics-listen must be HOST:PORT or [IPV6]:PORT");
  return Status::Ok();
}

}  // namespace

bool ListenAddress::IsLoopback() const {
  in_addr v4{};  // a name may begin with "127." and stand for any machine
  const bool numbers = inet_pton(AF_INET, host.c_str(), &v4) == 1;
  return IsUnix() || host == "localhost" || host == "::1" ||
         (numbers && (ntohl(v4.s_addr) >> 24) == 127);
}

std::string ListenAddress::Target() const {
  if (IsUnix()) return "unix:" + unix_path;
  const bool v6 = host.find(':') != std::string::npos;
  return (v6 ? "[" + host + "]" : host) + ":" + std::to_string(port);
}

core::Expected<ListenAddress> ParseListenAddress(const std::string& text, const std::string& flag) {
  ListenAddress address;
  if (text.starts_with("unix:")) {
    address.unix_path = text.substr(text.starts_with("unix://") ? 7 : 5);
    if (address.unix_path.empty() || address.unix_path.size() > kMaxUnixPath) {
      return core::Refuse(StatusCode::kInvalidArgument,
                          Message(flag, " is \"", text, "\" but a unix socket's path has 1 to ",
                                  kMaxUnixPath, " bytes: use a shorter one"));
    }
    return address;
  }
  const std::size_t colon = text.rfind(':');
  const std::string port = colon == std::string::npos ? "" : text.substr(colon + 1);
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), address.port);
  const bool good_port = error == std::errc() && end == port.data() + port.size() &&
                         address.port >= 0 && address.port <= 65535;
  address.host = text.substr(0, std::min(colon, text.size()));
  if (address.host.size() > 1 && address.host.front() == '[' && address.host.back() == ']') {
    address.host = address.host.substr(1, address.host.size() - 2);
  } else if (address.host.find(':') != std::string::npos) {
    address.host.clear();  // an IPv6 address without brackets: where does the port begin?
  }
  if (!good_port || address.host.empty()) {
    return core::Refuse(
        StatusCode::kInvalidArgument,
        Message(flag, " is \"", text, "\" but must be HOST:PORT, [IPV6]:PORT or unix:/PATH; port ",
                "0 takes a free one"));
  }
  return address;
}

Status Validate(const Config& config) {
  const auto address = ParseListenAddress(config.listen);
  if (!address) return address.error();
  const Status safety = ValidateSafety(config, *address);
  if (!safety.ok()) return safety;
  return CheckRanges(config);
}

Config WithDefaults(Config config) {
  if (config.max_memory_bytes == 0) config.max_memory_bytes = MachineBytes() / 4 * 3;
  if (config.owner_memory_bytes == 0) config.owner_memory_bytes = config.max_memory_bytes / 2;
  if (config.owner_meshes == 0) config.owner_meshes = config.max_meshes;
  return config;
}

double MaxWaitSeconds(const Config& config) {
  if (config.max_wait_seconds > 0) return config.max_wait_seconds;
  return config.data_dir.empty() ? 3600 : 30 * 86400.0;
}

std::size_t ChunkBytes(const Config& config) {
  return std::min(std::uint64_t{1} << 20, config.max_message_bytes / 2);
}

std::size_t PartBytes(const Config& config) {
  return std::min(std::size_t{1} << 17, ChunkBytes(config));
}

}  // namespace stellate::server
