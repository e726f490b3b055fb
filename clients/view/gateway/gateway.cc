#include "gateway.h"

#include <grpcpp/generic/generic_stub.h>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <chrono>
#include <optional>
#include <utility>

#include "call_socket.h"
#include "net/channel.h"
#include "page.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::view {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using boost::system::error_code;

constexpr std::uint32_t kMostHeaderBytes = 16384;
constexpr auto kPatience = std::chrono::seconds(15);
constexpr std::string_view kCalls = "/call/";

// Nothing from elsewhere, and no frame but a notebook's on this machine.
std::string Policy(const std::string& host) {
  return "default-src 'none'; script-src 'unsafe-inline' blob:; style-src 'unsafe-inline'; "
         "worker-src blob:; img-src data: blob:; connect-src ws://" +
         host +
         "; base-uri 'none'; form-action 'none'; "
         "frame-ancestors 'self' http://localhost:* http://127.0.0.1:*";
}

// A connection that asks once: for the page, or to become a call's socket.
class Visit : public std::enable_shared_from_this<Visit> {
 public:
  Visit(Shared& shared, tcp::socket socket, std::uint16_t port)
      : shared_(shared), stream_(std::move(socket)), port_(std::to_string(port)) {
    parser_.header_limit(kMostHeaderBytes);
    parser_.body_limit(0);
  }

  void Start() {
    shared_.sockets.Open(this, [this] { Leave(); });
    stream_.expires_after(kPatience);
    http::async_read(stream_, buffer_, parser_,
                     [self = shared_from_this()](error_code error, std::size_t) {
                       if (error) return self->Leave();
                       self->Answer();
                     });
  }

 private:
  // Whoever has another name for this address is another page, whose owner had it point here.
  bool IsOurs(std::string_view host) const {
    return host == "127.0.0.1:" + port_ || host == "localhost:" + port_;
  }

  void Answer() {
    const auto& request = parser_.get();
    const std::string host(request[http::field::host]);
    if (!IsOurs(host)) return Refuse(http::status::misdirected_request, "another host's address");
    const std::string target(request.target());
    if (beast::websocket::is_upgrade(request)) {
      if (request[http::field::origin] != "http://" + host)
        return Refuse(http::status::forbidden, "another page's call");
      if (target.rfind(kCalls, 0) != 0 || !IsCall(target.substr(kCalls.size())))
        return Refuse(http::status::not_found, "no such call");
      shared_.sockets.Close(this);
      return ServeCall(shared_, std::move(stream_), parser_.release());
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head)
      return Refuse(http::status::method_not_allowed, "the page can only be read");
    if (target != "/") return Refuse(http::status::not_found, "there is one page, at /");
    Expected<std::string_view> page = Page();
    if (!page) return Refuse(http::status::not_found, page.error().message);
    response_.set("Content-Security-Policy", Policy(host));
    Send(http::status::ok, "text/html; charset=utf-8", std::string(*page));
  }

  void Refuse(http::status status, const std::string& why) {
    Send(status, "text/plain; charset=utf-8", "stellate view: " + why + "\n");
  }

  void Send(http::status status, const char* type, std::string body) {
    response_.result(status);
    response_.version(11);
    response_.keep_alive(false);
    response_.set(http::field::content_type, type);
    response_.set(http::field::cache_control, "no-store");
    response_.set("X-Content-Type-Options", "nosniff");
    response_.set("Referrer-Policy", "no-referrer");
    response_.set("Cross-Origin-Resource-Policy", "same-origin");
    response_.body() = std::move(body);
    response_.prepare_payload();
    if (parser_.get().method() == http::verb::head) response_.body().clear();
    stream_.expires_after(kPatience);
    http::async_write(stream_, response_,
                      [self = shared_from_this()](error_code, std::size_t) { self->Leave(); });
  }

  void Leave() {
    error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    stream_.close();
    shared_.sockets.Close(this);
  }

  Shared& shared_;
  beast::tcp_stream stream_;
  const std::string port_;
  beast::flat_buffer buffer_;
  http::request_parser<http::string_body> parser_;
  http::response<http::string_body> response_;
};

}  // namespace

class Gateway::Impl {
 public:
  explicit Impl(GatewayOptions options) : shared_(options.port), options_(std::move(options)) {
    shared_.title = options_.title.empty() ? options_.connection.server : options_.title;
    shared_.mesh = options_.mesh;
  }

  Expected<void> Listen() {
    if (const auto page = Page(); !page) return tl::unexpected(page.error());
    const auto channel = client::Connect(options_.connection);
    if (!channel) return tl::unexpected(channel.error());
    shared_.stub = std::make_unique<grpc::GenericStub>(*channel);
    error_code error;
    const tcp::endpoint loopback(asio::ip::address_v4::loopback(), options_.port);
    acceptor_.open(loopback.protocol(), error);
    if (!error) acceptor_.set_option(asio::socket_base::reuse_address(true), error);
    if (!error) acceptor_.bind(loopback, error);
    if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
    if (error) {
      return Fail(ErrorCode::kRefused, "127.0.0.1:" + std::to_string(options_.port) +
                                           " cannot be listened at: " + error.message() +
                                           "; choose another --port, or none");
    }
    port_ = acceptor_.local_endpoint().port();
    return {};
  }

  std::string AddressWith(const std::string& secret) const {
    return "http://127.0.0.1:" + std::to_string(port_) + "/#" + secret +
           (options_.demo ? "&demo" : "");
  }
  Keys& keys() { return shared_.keys; }

  void Run(const std::stop_token& stop) {
    const std::stop_callback end(stop, [this] { asio::post(shared_.io, [this] { Stop(); }); });
    Accept();
    shared_.io.run();  // until the last call is over
  }

 private:
  void Accept() {
    acceptor_.async_accept([this](error_code error, tcp::socket socket) {
      if (!acceptor_.is_open()) return;
      if (!error && shared_.sockets.MakeRoom())
        std::make_shared<Visit>(shared_, std::move(socket), port_)->Start();
      Accept();
    });
  }

  void Stop() {
    error_code ignored;
    acceptor_.close(ignored);
    shared_.sockets.EndAll();
  }

  Shared shared_;
  const GatewayOptions options_;
  tcp::acceptor acceptor_{shared_.io};
  std::uint16_t port_ = 0;
};

Gateway::Gateway(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Gateway::~Gateway() = default;

Expected<std::unique_ptr<Gateway>> Gateway::Listen(GatewayOptions options) {
  auto impl = std::make_unique<Impl>(std::move(options));
  if (const auto ok = impl->Listen(); !ok) return tl::unexpected(ok.error());
  return std::unique_ptr<Gateway>(new Gateway(std::move(impl)));
}

std::string Gateway::Address() const { return impl_->AddressWith(impl_->keys().secret()); }
std::string Gateway::AddressForOnce() { return impl_->AddressWith(impl_->keys().NewForOnce()); }
void Gateway::Run(const std::stop_token& stop) { impl_->Run(stop); }

}  // namespace stellate::view
