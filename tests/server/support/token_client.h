#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stellate/v1/stellate.grpc.pb.h"
#include "tests/server/support/live_server.h"

namespace stellate::server::testing {

// One client: a connection, and a token to send along with every call; empty: none.
class TokenClient {
 public:
  TokenClient(const std::string& address, std::shared_ptr<grpc::ChannelCredentials> credentials,
              std::string token)
      : token_(std::move(token)) {
    grpc::ChannelArguments arguments;
    arguments.SetInt("grpc.use_local_subchannel_pool", 1);
    stub_ = v1::Stellate::NewStub(grpc::CreateCustomChannel(address, credentials, arguments));
  }

  grpc::Status Create(v1::Mesh* mesh, const v1::MeshSpec& spec, const std::string& id = "") {
    v1::CreateMeshRequest request;
    *request.mutable_spec() = spec;
    request.set_mesh_id(id);
    return stub_->CreateMesh(Context().get(), request, mesh);
  }
  grpc::Status Get(const std::string& name, v1::Mesh* mesh) {
    return Named<v1::GetMeshRequest>(name, &v1::Stellate::Stub::GetMesh, mesh);
  }
  grpc::Status List(v1::ListMeshesResponse* response, const std::string& page_token = "") {
    v1::ListMeshesRequest request;
    request.set_page_size(1);
    request.set_page_token(page_token);
    return stub_->ListMeshes(Context().get(), request, response);
  }
  grpc::Status Info() {
    v1::ServerInfo info;
    return stub_->GetServerInfo(Context().get(), {}, &info);
  }
  grpc::Status Cancel(const std::string& name) {
    v1::Mesh mesh;
    return Named<v1::CancelMeshRequest>(name, &v1::Stellate::Stub::CancelMesh, &mesh);
  }
  grpc::Status Delete(const std::string& name) {
    google::protobuf::Empty empty;
    return Named<v1::DeleteMeshRequest>(name, &v1::Stellate::Stub::DeleteMesh, &empty);
  }
  grpc::Status Watch(const std::string& name, v1::Mesh* final = nullptr) {
    const auto context = Context();
    v1::WatchMeshRequest request;
    request.set_name(name);
    const auto reader = stub_->WatchMesh(context.get(), request);
    v1::WatchMeshResponse event;
    while (reader->Read(&event)) {
      if (final != nullptr && event.has_final()) *final = event.final();
    }
    return reader->Finish();
  }
  grpc::Status Download(const std::string& name) {
    const auto context = Context();
    v1::DownloadMeshRequest request;
    request.set_name(name);
    const auto reader = stub_->DownloadMesh(context.get(), request);
    v1::DownloadMeshResponse part;
    while (reader->Read(&part)) {
    }
    return reader->Finish();
  }
  grpc::Status Serve(const std::string& name) {
    const auto context = Context();
    const auto stream = stub_->ServeOracle(context.get());
    v1::ServeOracleRequest request;
    request.mutable_hello()->set_mesh(name);
    stream->Write(request);
    v1::ServeOracleResponse response;
    while (stream->Read(&response)) {
      if (!response.has_queries()) continue;
      *request.mutable_answers() = TrueAnswer(response.queries());
      stream->Write(request);
    }
    return stream->Finish();
  }

  // What there is to ask of a mesh that exists.
  std::vector<std::pair<const char*, grpc::Status>> AskAllOf(const std::string& name) {
    v1::Mesh mesh;
    return {{"GetMesh", Get(name, &mesh)},
            {"WatchMesh", Watch(name)},
            {"ServeOracle", Serve(name)},
            {"CancelMesh", Cancel(name)},
            {"DeleteMesh", Delete(name)}};
  }

 private:
  std::unique_ptr<grpc::ClientContext> Context() const {
    auto context = std::make_unique<grpc::ClientContext>();
    if (!token_.empty()) context->AddMetadata("authorization", "Bearer " + token_);
    return context;
  }
  template <typename Request, typename Response>
  grpc::Status Named(const std::string& name,
                     grpc::Status (v1::Stellate::Stub::*call)(grpc::ClientContext*, const Request&,
                                                              Response*),
                     Response* response) {
    Request request;
    request.set_name(name);
    return (stub_.get()->*call)(Context().get(), request, response);
  }

  const std::string token_;
  std::unique_ptr<v1::Stellate::Stub> stub_;
};

}  // namespace stellate::server::testing
