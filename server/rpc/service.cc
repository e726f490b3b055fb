#include "server/rpc/service.h"

#include <google/protobuf/descriptor.h>
#include <grpcpp/generic/generic_stub.h>

#include <optional>
#include <utility>

#include "core/base/message.h"
#include "server/rpc/routing.h"
#include "server/rpc/rpcs.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::server {
namespace {

template <typename Request>
void FindRoute(Router& router, const Request& request, bool is_passed_on, Router::Then then) {
  const std::string mesh = MeshNamedIn(request);
  if (mesh.empty()) return then({});
  router.Find(mesh, is_passed_on, std::move(then));
}
void FindRoute(Router& router, const v1::ListMeshesRequest& request, bool is_passed_on,
               Router::Then then) {
  router.FindPage(request.page_token(), is_passed_on, std::move(then));
}

// One request, one response.
template <typename Request, typename Response>
class UnaryCall final : public grpc::ServerBidiReactor<Request, Response> {
 public:
  using Handler = grpc::Status (*)(const Call&, const Request&, Response*);

  UnaryCall(ServerState& state, const grpc::CallbackServerContext& context, Handler handler)
      : handler_(handler), context_(context) {
    auto caller = Identify(state, context);
    if (!caller) {
      this->Finish(caller.error());
      return;
    }
    std::string address = caller->is_passed_on ? caller->address : context.peer();
    call_.emplace(Call{state, std::move(*caller), std::move(address)});
    this->StartRead(&request_);
  }

  void OnReadDone(bool ok) override {
    if (!ok) return this->Finish(NoRequest());
    FindRoute(call_->state.router, request_, call_->caller.is_passed_on,
              [this](Route route) { Follow(std::move(route)); });
  }

  void OnCancel() override { passed_on_.TryCancel(); }
  void OnDone() override { delete this; }

 private:
  void Follow(Route route) {
    route_ = std::move(route);
    switch (route_.kind) {
      case Route::Kind::kHere:
        return Reply(Guarded([this] { return handler_(*call_, request_, &response_); }));
      case Route::Kind::kNotNow:
        return Reply(MovedAway());
      case Route::Kind::kThere:
        break;
    }
    call_->state.router.Introduce(route_, call_->caller, call_->peer, context_, &passed_on_);
    grpc::TemplatedGenericStub<Request, Response>(route_.channel)
        .UnaryCall(&passed_on_, PathOf<Request>(), {}, &request_, &response_,
                   [this](grpc::Status status) { Reply(FromPeer(std::move(status))); });
  }

  void Reply(grpc::Status status) {
    if (!status.ok()) return this->Finish(std::move(status));
    this->StartWriteAndFinish(&response_, grpc::WriteOptions(), std::move(status));
  }

  const Handler handler_;
  const grpc::CallbackServerContext& context_;
  std::optional<Call> call_;
  Request request_;
  Response response_;
  Route route_;
  grpc::ClientContext passed_on_;
};

}  // namespace

template <typename Request, typename Response>
void Rpcs::Add(const char* path, Begin<Request, Response> begin) {
  using grpc::internal::RpcServiceMethod;
  AddMethod(new RpcServiceMethod(path, RpcServiceMethod::BIDI_STREAMING, nullptr));
  MarkMethodCallback(count_++,
                     new grpc::internal::CallbackBidiHandler<Request, Response>(std::move(begin)));
}

template <typename Request, typename Response>
void Rpcs::AddUnary(const char* path,
                    grpc::Status (*handler)(const Call&, const Request&, Response*)) {
  Add<Request, Response>(path, [this, handler](grpc::CallbackServerContext* context) {
    return new UnaryCall<Request, Response>(state_, *context, handler);
  });
}

template <typename Request, typename Response>
void Rpcs::AddStream(const char* path, grpc::ServerBidiReactor<Request, Response>* (*handler)(
                                           ServerState&, grpc::CallbackServerContext*)) {
  Add<Request, Response>(path, [this, handler](grpc::CallbackServerContext* context) {
    return handler(state_, context);
  });
}

Rpcs::Rpcs(ServerState* state) : state_(*state) {
  AddStream("/stellate.v1.Stellate/CreateMesh", CreateMesh);
  AddUnary("/stellate.v1.Stellate/GetMesh", GetMesh);
  AddUnary("/stellate.v1.Stellate/ListMeshes", ListMeshes);
  AddUnary("/stellate.v1.Stellate/CancelMesh", CancelMesh);
  AddUnary("/stellate.v1.Stellate/DeleteMesh", DeleteMesh);
  AddUnary("/stellate.v1.Stellate/GetServerInfo", GetServerInfo);
  AddStream("/stellate.v1.Stellate/ServeOracle", ServeOracle);
  AddStream("/stellate.v1.Stellate/Examine", Examine);
  AddStream("/stellate.v1.Stellate/Reconstruct", Reconstruct);
  AddStream("/stellate.v1.Stellate/WatchMesh", WatchMesh);
  AddStream("/stellate.v1.Stellate/DownloadMesh", DownloadMesh);
}

bool Rpcs::Serves(std::string_view path) {
  static const auto* const service =
      google::protobuf::DescriptorPool::generated_pool()->FindServiceByName(
          v1::Stellate::service_full_name());
  static const std::string prefix = core::Message("/", v1::Stellate::service_full_name(), "/");
  return path.substr(0, prefix.size()) == prefix &&
         service->FindMethodByName(std::string(path.substr(prefix.size()))) != nullptr;
}

grpc::ServerGenericBidiReactor* UnknownRpcs::CreateReactor(
    grpc::GenericCallbackServerContext* /*context*/) {
  class Unknown final : public grpc::ServerGenericBidiReactor {
   public:
    Unknown() {
      Finish({grpc::StatusCode::UNIMPLEMENTED,
              "this server has no such method: it speaks stellate.v1"});
    }
    void OnDone() override { delete this; }
  };
  return new Unknown;
}

}  // namespace stellate::server
