#pragma once

#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/support/loopback.h"

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
  void Call(const std::string& rpc, int count, bool reset,
            const std::vector<std::pair<std::string, std::string>>& more = {}) {
    const std::string header = HeadersOf(rpc, more);
    for (int i = 0; i < count; ++i, stream_ += 2) {
      std::string frames = Frame(kHeaders, kEndHeaders, stream_, header);
      if (reset) frames += Frame(kReset, 0, stream_, std::string("\0\0\0\x08", 4));
      if (!Send(frames)) return;
    }
  }

  // What HPACK makes of a call's headers, of a path or an rpc of ours, and of some of the caller's
  // own.
  static std::string HeadersOf(const std::string& rpc,
                               const std::vector<std::pair<std::string, std::string>>& more = {}) {
    std::string block;
    const auto add = [&block](const std::string& name, const std::string& value) {
      block += std::string(1, '\0') + Prefixed(name) + Prefixed(value);
    };
    add(":method", "POST");
    add(":scheme", "http");
    add(":path", rpc.front() == '/' ? rpc : "/stellate.v1.Stellate/" + rpc);
    add(":authority", "localhost");
    add("content-type", "application/grpc");
    add("te", "trailers");
    for (const auto& [name, value] : more) add(name, value);
    return block;
  }

  // A new call's headers, in frames of at most this number of bytes. False: the connection is
  // closed.
  bool Headers(const std::string& block, std::size_t frame_bytes, bool end) {
    for (std::size_t at = 0; at < block.size() || at == 0; at += frame_bytes) {
      const bool last = end && at + frame_bytes >= block.size();
      if (!Send(Frame(at == 0 ? kHeaders : kContinuation, last ? kEndHeaders : 0, stream_,
                      block.substr(at, frame_bytes)))) {
        return false;
      }
    }
    if (end) stream_ += 2;
    return true;
  }

  // More of the headers whose end did not come.
  bool MoreHeaders(const std::string& block) {
    return Send(Frame(kContinuation, 0, stream_, block));
  }

  // Begins a call and sends the first `bytes` of a message of `declared` ones. A message's part
  // must not be larger than what a server takes unasked, 60,000 bytes on a connection. False: it is
  // closed.
  bool Request(const std::string& rpc, std::uint32_t declared, std::size_t bytes) {
    return Request(rpc, declared, std::string(bytes, '\0'));
  }
  // Begins a call with a whole message.
  bool Request(const std::string& rpc, const std::string& message) {
    return Request(rpc, static_cast<std::uint32_t>(message.size()), message);
  }
  // The headers of the first call to end, as they came; gRPC leaves text as it is. "": the
  // connection was closed before.
  std::string AwaitAnswer() {
    std::string read;
    char bytes[4096];
    for (ssize_t n = 0; (n = recv(fd_, bytes, sizeof(bytes), 0)) > 0;) {
      read.append(bytes, static_cast<std::size_t>(n));
      while (read.size() >= kFrameHeader) {
        const std::size_t size = Byte(read, 0) << 16 | Byte(read, 1) << 8 | Byte(read, 2);
        if (read.size() < kFrameHeader + size) break;
        if (read[3] == kHeaders && (read[4] & kEndStream) != 0) {
          return read.substr(kFrameHeader, size);
        }
        read.erase(0, kFrameHeader + size);
      }
    }
    return "";
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
  bool Request(const std::string& rpc, std::uint32_t declared, const std::string& part) {
    std::string message(1, '\0');
    for (int shift = 24; shift >= 0; shift -= 8) message += static_cast<char>(declared >> shift);
    message += part;
    std::string frames = Frame(kHeaders, kEndHeaders, stream_, HeadersOf(rpc));
    for (std::size_t at = 0; at < message.size(); at += kFrameBytes) {
      frames += Frame(kData, 0, stream_, message.substr(at, kFrameBytes));
    }
    stream_ += 2;
    return Send(frames);
  }

  static constexpr std::size_t kFrameBytes = 16 << 10;
  static constexpr char kData = 0, kHeaders = 1, kReset = 3, kSettings = 4, kPing = 6,
                        kContinuation = 9;
  static constexpr char kAck = 1, kEndStream = 1, kEndHeaders = 4;
  static constexpr std::size_t kFrameHeader = 9;

  static std::size_t Byte(const std::string& bytes, std::size_t i) {
    return static_cast<unsigned char>(bytes[i]);
  }

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

  // A string of HPACK: its length and itself.
  static std::string Prefixed(const std::string& text) {
    if (text.size() < 127) return static_cast<char>(text.size()) + text;
    std::string length(1, 127);
    std::size_t rest = text.size() - 127;
    for (; rest >= 128; rest /= 128) length += static_cast<char>(rest % 128 | 128);
    return length + static_cast<char>(rest) + text;
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
