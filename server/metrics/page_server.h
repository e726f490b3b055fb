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

// Answers GET and HEAD over plain HTTP, a request a connection, on one thread of its own. No number
// of silent connections keeps others from being answered: of too many the eldest is closed.
class PageServer {
 public:
  // The page at a path, as it was asked for; called on the thread.
  using Pages = std::function<Page(std::string_view path)>;

  // At every address that `address`, "host:port" or "[ipv6]:port", stands for; port 0 takes a free
  // one. kFailedPrecondition: none of them can be had; the message has no start and no advice.
  static core::Expected<std::unique_ptr<PageServer>> Listen(const std::string& address,
                                                            Pages pages);
  // Nothing is asked of `pages` after this.
  ~PageServer();

  int port() const;

 private:
  class Impl;
  explicit PageServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace stellate::server
