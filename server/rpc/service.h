#pragma once

#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/impl/service_type.h>

#include <functional>
#include <string_view>

#include "server/rpc/call.h"

namespace stellate::server {

// The rpcs of stellate.v1. gRPC reports a unary call, or one that is answered by a stream, once its
// request is complete; until then it would keep the request of any client, without a token. So each
// rpc is implemented as a stream in both directions, which looks the same to its client: gRPC
// reports it when the headers have arrived. An unknown caller is refused then, and the request is
// not read.
class Rpcs final : public grpc::Service {
 public:
  // Whether an rpc has this path on the wire.
  static bool Serves(std::string_view path);

  explicit Rpcs(ServerState* state);

 private:
  template <typename Request, typename Response>
  using Begin = std::function<grpc::ServerBidiReactor<Request, Response>*(
      grpc::CallbackServerContext* context)>;

  // `path`: as it is on the wire; stays alive.
  template <typename Request, typename Response>
  void Add(const char* path, Begin<Request, Response> begin);
  template <typename Request, typename Response>
  void AddUnary(const char* path, grpc::Status (*handler)(const Call&, const Request&, Response*));
  template <typename Request, typename Response>
  void AddStream(const char* path, grpc::ServerBidiReactor<Request, Response>* (*handler)(
                                       ServerState&, grpc::CallbackServerContext*));

  ServerState& state_;
  int count_ = 0;
};

// Unknown methods: UNIMPLEMENTED, at the headers as well.
class UnknownRpcs final : public grpc::CallbackGenericService {
 public:
  grpc::ServerGenericBidiReactor* CreateReactor(
      grpc::GenericCallbackServerContext* context) override;
};

}  // namespace stellate::server
