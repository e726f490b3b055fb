#pragma once

#include <grpcpp/generic/generic_stub.h>

#include <boost/asio/io_context.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <memory>
#include <string>

#include "keys.h"
#include "sockets.h"

namespace stellate::view {

using HttpRequest = boost::beast::http::request<boost::beast::http::string_body>;

// What all sockets share. Only the thread of `io` may use it, except the stub.
struct Shared {
  explicit Shared(std::uint16_t port) : keys(port) {}

  boost::asio::io_context io{1};
  std::unique_ptr<grpc::GenericStub> stub;
  Keys keys;
  std::string title, mesh;  // as GatewayOptions has them
  Sockets sockets;
};

// The calls that a page may make: those that change nothing.
bool IsCall(std::string_view method);

// One call of the protocol over one WebSocket, which `request` asks for:
//
//   gateway  {"nonce": N}
//   page     "PROOF NONCE"
//   gateway  {"proof", "server", "mesh", "secret"}     secret: in the place of one for once
//   page     the request, as bytes
//   gateway  responses, as bytes, a message each
//   page     "BYTES" taken in; no more than 4 MB are under way
//   gateway  {"end": {"code", "message"}}, and closes
void ServeCall(Shared& shared, boost::beast::tcp_stream stream, HttpRequest request);

}  // namespace stellate::view
