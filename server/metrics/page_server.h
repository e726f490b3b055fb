#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "core/status.h"

namespace stellate::server {

struct Page {
  int status = 200;  // of HTTP
  std::string type = "text/plain; charset=utf-8";
  std::string body;
};

// Answers GET and HEAD over plain HTTP, one request a connection, on one thread. Silent connections
// do not block others: of too many the oldest is closed.
class PageServer {
 public:
  // Returns the page at a path; called on the server's thread.
  using Pages = std::function<Page(std::string_view path)>;

  // Listens at every address of `address`, "host:port" or "[ipv6]:port"; port 0 takes a free one.
  // kFailedPrecondition: none is available; the caller completes the message.
  static core::Expected<std::unique_ptr<PageServer>> Listen(const std::string& address,
                                                            Pages pages);
  // Calls `pages` no more.
  ~PageServer();

  int port() const;

 private:
  class Impl;
  explicit PageServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace stellate::server
