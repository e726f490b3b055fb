#include "server/metrics/page_server.h"

#include <netdb.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <list>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/message.h"
#include "server/base/clock.h"

namespace stellate::server {
namespace {

using core::Message;

constexpr std::size_t kMostVisits = 64;  // at once: a scraper has one, a browser six
constexpr std::size_t kMostRequestBytes = 8192;
constexpr auto kPatience = std::chrono::seconds(5);  // with a request, and with who reads the reply
constexpr int kTickMilliseconds = 250;
constexpr int kNoFilesMilliseconds = 50;  // while there is no file left to accept with

const char* ReasonOf(int status) {
  switch (status) {
    case 200:
      return "OK";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 503:
      return "Service Unavailable";
    default:
      return "Bad Request";
  }
}

// Of HTTP no more than a GET needs: the request's first line, and a reply that ends with the
// connection.
std::string ReplyTo(const std::string& request, const PageServer::Pages& pages) {
  const std::string line = request.substr(0, request.find("\r\n"));
  const std::size_t method_end = line.find(' ');
  const std::size_t target_end = line.find(' ', method_end + 1);
  const bool is_http = method_end != std::string::npos && target_end != std::string::npos &&
                       line.compare(target_end + 1, 7, "HTTP/1.") == 0;
  const std::string method = line.substr(0, method_end);
  Page page{400, "text/plain; charset=utf-8", "this is no request of HTTP/1\n"};
  if (is_http && (method == "GET" || method == "HEAD")) {
    const std::string target = line.substr(method_end + 1, target_end - method_end - 1);
    page = pages(std::string_view(target).substr(0, target.find('?')));
  } else if (is_http) {
    page = {405, "text/plain; charset=utf-8", "these pages can only be read\n"};
  }
  std::string reply =
      Message("HTTP/1.1 ", page.status, " ", ReasonOf(page.status), "\r\nContent-Type: ", page.type,
              "\r\nContent-Length: ", page.body.size(),
              "\r\nConnection: close\r\nCache-Control: no-store\r\nX-Content-Type-Options: nosniff"
              "\r\nContent-Security-Policy: default-src 'none'; style-src 'unsafe-inline'\r\n\r\n");
  return method == "HEAD" ? reply : reply + page.body;
}

// One connection: its request comes, its reply goes, and it waits for the other side to hang up.
struct Visit {
  int fd = -1;
  Clock::time_point came = {};
  std::string request, reply;
  std::size_t sent = 0;

  bool Answers() const { return sent < reply.size(); }
};

}  // namespace

class PageServer::Impl {
 public:
  explicit Impl(Pages pages) : pages_(std::move(pages)), wake_(eventfd(0, EFD_CLOEXEC)) {}
  ~Impl() {
    thread_.request_stop();
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = write(wake_, &one, sizeof(one));
    if (thread_.joinable()) thread_.join();
    for (const Visit& visit : visits_) close(visit.fd);
    for (const int fd : sockets_) close(fd);
    close(wake_);
  }

  core::Status Listen(const std::string& address) {
    const std::size_t colon = address.rfind(':');
    std::string host = address.substr(0, colon);
    if (host.size() > 1 && host.front() == '[') host = host.substr(1, host.size() - 2);
    addrinfo hints{};
    hints.ai_flags = AI_PASSIVE;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    int error = 0;
    std::string port = address.substr(colon + 1);
    const int unknown = getaddrinfo(host.c_str(), port.c_str(), &hints, &found);
    if (unknown != 0) return {core::StatusCode::kFailedPrecondition, gai_strerror(unknown)};
    for (const addrinfo* at = found; at != nullptr; at = at->ai_next) {
      // One port for all, also where it is a free one.
      if (!sockets_.empty()) std::memcpy(at->ai_addr->sa_data, &port_, sizeof(port_));
      if (const int fd = Bind(*at); fd >= 0) {
        sockets_.push_back(fd);
      } else {
        error = errno;
      }
    }
    freeaddrinfo(found);
    if (sockets_.empty()) return {core::StatusCode::kFailedPrecondition, std::strerror(error)};
    thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
    return core::Status::Ok();
  }

  int port() const { return ntohs(port_); }

 private:
  int Bind(const addrinfo& address) {
    const int fd = socket(address.ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) return -1;
    const int on = 1;
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
    sockaddr_storage bound{};
    socklen_t size = sizeof(bound);
    if (bind(fd, address.ai_addr, address.ai_addrlen) == 0 && listen(fd, SOMAXCONN) == 0 &&
        getsockname(fd, reinterpret_cast<sockaddr*>(&bound), &size) == 0) {
      // At the same place in both kinds of address.
      std::memcpy(&port_, reinterpret_cast<sockaddr*>(&bound)->sa_data, sizeof(port_));
      return fd;
    }
    close(fd);
    return -1;
  }

  void Run(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      std::vector<pollfd> watched = {{wake_, POLLIN, 0}};
      for (const int fd : sockets_) watched.push_back({fd, POLLIN, 0});
      for (const Visit& visit : visits_)
        watched.push_back({visit.fd, static_cast<short>(visit.Answers() ? POLLOUT : POLLIN), 0});
      poll(watched.data(), watched.size(), visits_.empty() ? -1 : kTickMilliseconds);
      auto state = watched.begin() + 1 + static_cast<std::ptrdiff_t>(sockets_.size());
      for (auto visit = visits_.begin(); visit != visits_.end(); ++state) {
        const bool over =
            Clock::now() - visit->came > kPatience || (state->revents != 0 && !Serve(&*visit));
        if (over) close(visit->fd);
        visit = over ? visits_.erase(visit) : std::next(visit);
      }
      for (std::size_t i = 0; i < sockets_.size(); ++i)
        if (watched[i + 1].revents != 0) Accept(sockets_[i]);
    }
  }

  void Accept(int socket) {
    const int fd = accept4(socket, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0) {
      // It would be here again at once.
      if (errno != EAGAIN) poll(nullptr, 0, kNoFilesMilliseconds);
      return;
    }
    if (visits_.size() >= kMostVisits) {
      close(visits_.front().fd);
      visits_.pop_front();
    }
    visits_.push_back({fd, Clock::now(), "", ""});
  }

  // False: it is over.
  bool Serve(Visit* visit) {
    if (visit->Answers()) {
      const ssize_t sent = send(visit->fd, visit->reply.data() + visit->sent,
                                visit->reply.size() - visit->sent, MSG_NOSIGNAL);
      if (sent < 0) return errno == EAGAIN;
      visit->sent += static_cast<std::size_t>(sent);
      if (!visit->Answers()) shutdown(visit->fd, SHUT_WR);
      return true;
    }
    char bytes[4096];
    const ssize_t came = recv(visit->fd, bytes, sizeof(bytes), 0);
    if (came <= 0) return came < 0 && errno == EAGAIN;
    if (!visit->reply.empty()) return true;  // it was answered
    visit->request.append(bytes, static_cast<std::size_t>(came));
    if (visit->request.find("\r\n\r\n") == std::string::npos)
      return visit->request.size() <= kMostRequestBytes;
    visit->reply = ReplyTo(visit->request, pages_);
    visit->came = Clock::now();
    return true;
  }

  const Pages pages_;
  const int wake_;  // readable once it is to stop
  std::vector<int> sockets_;
  in_port_t port_ = 0;       // as the network writes it
  std::list<Visit> visits_;  // the eldest first
  std::jthread thread_;
};

core::Expected<std::unique_ptr<PageServer>> PageServer::Listen(const std::string& address,
                                                               Pages pages) {
  auto impl = std::make_unique<Impl>(std::move(pages));
  if (core::Status status = impl->Listen(address); !status.ok())
    return tl::unexpected(std::move(status));
  return std::unique_ptr<PageServer>(new PageServer(std::move(impl)));
}

PageServer::PageServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PageServer::~PageServer() = default;

int PageServer::port() const { return impl_->port(); }

}  // namespace stellate::server
