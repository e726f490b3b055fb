#include "server/net/channelz.h"

#include <arpa/inet.h>
#include <grpc/grpc.h>
#include <grpc/support/alloc.h>
#include <sys/socket.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <vector>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Message;

// Answers are the JSON of channelz's protocol without blanks, in which numbers of 64 bits stand in
// quotes. A whole parser would take longer than the server has for it many times a second.
std::string Taken(char* json) {
  const std::unique_ptr<char, void (*)(void*)> owned(json, gpr_free);
  return json == nullptr ? "" : json;
}

// The first number behind `key`, from `at` on.
std::optional<std::int64_t> NumberBehind(std::string_view json, std::string_view key,
                                         std::size_t at = 0) {
  const std::size_t found = json.find(key, at);
  if (found == std::string_view::npos) return std::nullopt;
  const std::size_t digit = json.find_first_of("0123456789", found + key.size());
  if (digit == std::string_view::npos) return std::nullopt;
  std::int64_t value = 0;
  std::from_chars(json.data() + digit, json.data() + json.size(), value);
  return value;
}

std::vector<std::intptr_t> Servers() {
  constexpr std::string_view kKey = "\"serverId\"";
  const std::string json = Taken(grpc_channelz_get_servers(0));
  std::vector<std::intptr_t> ids;
  for (std::size_t at = 0; (at = json.find(kKey, at)) != std::string::npos; at += kKey.size()) {
    ids.push_back(NumberBehind(json, kKey, at).value_or(0));
  }
  return ids;
}

}  // namespace

void ForEachConnection(const std::function<void(std::string_view, ConnectionId)>& take) {
  // ... {"name":"chttp2 ipv4:127.0.0.1:1234","socketId":"5"} ...
  constexpr std::string_view kBefore = "\"name\":\"chttp2 ";
  constexpr std::intptr_t kAll = 1 << 24;
  for (const std::intptr_t server : Servers()) {
    const std::string json = Taken(grpc_channelz_get_server_sockets(server, 0, kAll));
    for (std::size_t at = 0; (at = json.find(kBefore, at)) != std::string::npos;) {
      at += kBefore.size();
      const std::string_view peer = std::string_view(json).substr(at, json.find('"', at) - at);
      take(peer, NumberBehind(json, "\"socketId\"", at).value_or(0));
    }
  }
}

bool CameToPort(int port, ConnectionId id) {
  const std::string json = Taken(grpc_channelz_get_socket(id));
  const std::size_t local = json.find("\"local\"");
  return local != std::string::npos && NumberBehind(json, "\"port\"", local) == port;
}

std::optional<std::size_t> CallsHeld(ConnectionId id) {
  const std::string json = Taken(grpc_channelz_get_socket(id));
  if (json.empty()) return std::nullopt;
  // gRPC counts an end when it frees the stream. The key is missing while there is none.
  const std::int64_t calls = NumberBehind(json, "\"streamsStarted\"").value_or(0) -
                             NumberBehind(json, "\"streamsSucceeded\"").value_or(0) -
                             NumberBehind(json, "\"streamsFailed\"").value_or(0);
  return static_cast<std::size_t>(std::max<std::int64_t>(calls, 0));
}

std::string PeerOf(int fd) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  if (getpeername(fd, reinterpret_cast<sockaddr*>(&address), &size) != 0) return "";
  char host[INET6_ADDRSTRLEN] = "";
  if (address.ss_family == AF_INET) {
    const auto& v4 = reinterpret_cast<const sockaddr_in&>(address);
    inet_ntop(AF_INET, &v4.sin_addr, host, sizeof(host));
    return Message("ipv4:", host, ":", ntohs(v4.sin_port));
  }
  const auto& v6 = reinterpret_cast<const sockaddr_in6&>(address);
  if (IN6_IS_ADDR_V4MAPPED(&v6.sin6_addr)) {
    inet_ntop(AF_INET, &v6.sin6_addr.s6_addr[12], host, sizeof(host));
    return Message("ipv4:", host, ":", ntohs(v6.sin6_port));
  }
  inet_ntop(AF_INET6, &v6.sin6_addr, host, sizeof(host));
  return Message("ipv6:%5B", host, "%5D:", ntohs(v6.sin6_port));
}

}  // namespace stellate::server
