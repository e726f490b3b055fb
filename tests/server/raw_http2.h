#pragma once

#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "tests/server/loopback.h"

namespace stellate::server::testing {

// HTTP/2 as no library would let one speak it: settings are not acknowledged, calls are begun
// beyond every bound, and reset at once. To a port of the loopback.
class RawHttp2 {
 public:
  explicit RawHttp2(int port) : fd_(ConnectTo(port)) {
    Send("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + Frame(kSettings, 0, 0, ""));
  }
  ~RawHttp2() { close(fd_); }

  // Begins `count` calls of an rpc; `reset`: and gives each up at once.
  void Call(const std::string& rpc, int count, bool reset) {
    std::string header;
    for (const auto& [name, value] : {std::pair<std::string, std::string>{":method", "POST"},
                                      {":scheme", "http"},
                                      {":path", "/stellate.v1.Stellate/" + rpc},
                                      {":authority", "localhost"},
                                      {"content-type", "application/grpc"},
                                      {"te", "trailers"}}) {
      header += std::string(1, '\0') + static_cast<char>(name.size()) + name;
      header += static_cast<char>(value.size()) + value;
    }
    for (int i = 0; i < count; ++i, stream_ += 2) {
      std::string frames = Frame(kHeaders, kEndHeaders, stream_, header);
      if (reset) frames += Frame(kReset, 0, stream_, std::string("\0\0\0\x08", 4));
      if (!Send(frames)) return;
    }
  }

  // Waits until the server has closed the connection, whatever it says before.
  void AwaitEnd() {
    char bytes[4096];
    while (recv(fd_, bytes, sizeof(bytes), 0) > 0) continue;
  }

  // Asks for a sign of life, which comes after what was sent before was read. False: it is closed.
  bool IsAlive() {
    const std::string sign = "alive???";
    if (!Send(Frame(kPing, 0, 0, sign))) return false;
    const std::string reply = Frame(kPing, kAck, 0, sign);
    std::string read;
    char bytes[4096];
    for (ssize_t n = 0; (n = recv(fd_, bytes, sizeof(bytes), 0)) > 0;) {
      read.append(bytes, static_cast<std::size_t>(n));
      if (read.find(reply) != std::string::npos) return true;
    }
    return false;
  }

 private:
  static constexpr char kHeaders = 1, kReset = 3, kSettings = 4, kPing = 6;
  static constexpr char kAck = 1, kEndHeaders = 4;

  static std::string Frame(char kind, char flags, std::uint32_t stream,
                           const std::string& payload) {
    std::string frame(9, '\0');
    frame[1] = static_cast<char>(payload.size() >> 8);
    frame[2] = static_cast<char>(payload.size());
    frame[3] = kind;
    frame[4] = flags;
    for (std::size_t i = 0; i < 4; ++i) frame[5 + i] = static_cast<char>(stream >> (24 - 8 * i));
    return frame + payload;
  }

  bool Send(const std::string& bytes) {
    for (std::size_t at = 0; at < bytes.size();) {
      const ssize_t sent = send(fd_, bytes.data() + at, bytes.size() - at, MSG_NOSIGNAL);
      if (sent <= 0) return false;
      at += static_cast<std::size_t>(sent);
    }
    return true;
  }

  const int fd_;
  std::uint32_t stream_ = 1;
};

}  // namespace stellate::server::testing
