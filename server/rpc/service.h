#pragma once

#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/impl/service_type.h>

#include <functional>
#include <string_view>

#include "server/rpc/call.h"

namespace stellate::server {

// The rpcs of stellate.v1. gRPC tells of a unary call, or of one that is answered by a stream, once
// its request is whole: until then anybody could have it kept, with no token asked for. So each is
// taken as a stream in both directions, which looks the same to its client; of those gRPC tells
// when the headers have come. A caller who is not known is refused then, and his request not read.
class Rpcs final : public grpc::Service {
 public:
  // By its path on the wire.
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

// What nobody serves: UNIMPLEMENTED, at the headers as well.
class UnknownRpcs final : public grpc::CallbackGenericService {
 public:
  grpc::ServerGenericBidiReactor* CreateReactor(
      grpc::GenericCallbackServerContext* context) override;
};

}  // namespace stellate::server
