#include "server/config/listen_address.h"

#include <arpa/inet.h>

#include <algorithm>
#include <charconv>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Message;
using core::StatusCode;

constexpr std::size_t kMaxUnixPath = 107;  // what sockaddr_un holds

}  // namespace

bool ListenAddress::IsLoopback() const {
  in_addr v4{};  // a name may begin with "127." and stand for any machine
  const bool numbers = inet_pton(AF_INET, host.c_str(), &v4) == 1;
  return IsUnix() || host == "localhost" || host == "::1" ||
         (numbers && (ntohl(v4.s_addr) >> 24) == 127);
}

bool ListenAddress::IsEvery() const { return host == "0.0.0.0" || host == "::" || host == "*"; }

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

}  // namespace stellate::server
