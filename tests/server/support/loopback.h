#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

namespace stellate::server::testing {

// Connects to a port of the loopback; the caller closes. -1: nobody listens.
inline int TryConnect(int port) {
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  place.sin_port = htons(static_cast<in_port_t>(port));
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (connect(fd, reinterpret_cast<sockaddr*>(&place), sizeof(place)) == 0) return fd;
  close(fd);
  return -1;
}

inline int ConnectTo(int port) {
  const int fd = TryConnect(port);
  EXPECT_GE(fd, 0) << "nobody listens";
  return fd;
}

// The reply to a GET, headers included; "" when nobody listens.
inline std::string GetPage(int port, const std::string& path) {
  const int fd = TryConnect(port);
  if (fd < 0) return "";
  const std::string request = "GET " + path + " HTTP/1.0\r\n\r\n";
  EXPECT_EQ(send(fd, request.data(), request.size(), 0), static_cast<ssize_t>(request.size()));
  std::string reply;
  char bytes[4096];
  for (ssize_t n = 0; (n = recv(fd, bytes, sizeof(bytes), 0)) > 0;) {
    reply.append(bytes, static_cast<std::size_t>(n));
  }
  close(fd);
  return reply;
}
inline std::string GetMetrics(int port) { return GetPage(port, "/metrics"); }

}  // namespace stellate::server::testing
