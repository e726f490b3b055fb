#include "server/config/collector_url.h"

#include <algorithm>
#include <cctype>
#include <string_view>

#include "core/base/message.h"
#include "server/config/listen_address.h"

namespace stellate::server {
namespace {

constexpr std::string_view kPlain = "http://", kTls = "https://";

// gRPC reads much else out of what it dials: names of resolvers, lists, paths of sockets.
bool IsHost(const std::string& host) {
  return std::all_of(host.begin(), host.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '.' || c == '-' || c == '_' || c == ':';
  });
}

}  // namespace

core::Expected<CollectorUrl> ParseCollectorUrl(const std::string& text, const std::string& name) {
  CollectorUrl url;
  url.tls = text.starts_with(kTls);
  const bool has_scheme = url.tls || text.starts_with(kPlain);
  std::string rest = has_scheme ? text.substr(url.tls ? kTls.size() : kPlain.size()) : "";
  if (rest.ends_with('/')) rest.pop_back();
  const bool has_port =
      rest.find(':', rest.starts_with('[') ? rest.find(']') : 0) != std::string::npos;
  const auto address = ParseListenAddress(has_port ? rest : rest + ":4317", name);
  if (!has_scheme || !address || address->IsUnix() || address->port == 0 ||
      !IsHost(address->host)) {
    return core::Refuse(core::StatusCode::kInvalidArgument,
                        core::Message(name, " is \"", text,
                                      "\" but must be http://HOST:PORT, or https://HOST:PORT for "
                                      "TLS, of a collector that takes OTLP over gRPC, as most do "
                                      "on port 4317"));
  }
  url.target = address->Target();
  url.is_local = address->IsLoopback();
  return url;
}

}  // namespace stellate::server
