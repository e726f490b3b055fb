#include "replay.h"

#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server_builder.h>

#include <chrono>

namespace stellate::testing {

Replay::Replay(const Entry& entry) : entry_(entry), attempts_(ListAt(entry, "attempts")) {
  int port = 0;
  grpc::ServerBuilder builder;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(this);
  server_ = builder.BuildAndStart();
  address_ = "127.0.0.1:" + std::to_string(port);
}

Replay::~Replay() { server_->Shutdown(std::chrono::system_clock::now()); }

std::vector<std::uint64_t> Replay::from_revisions() {
  const std::lock_guard lock(mutex_);
  return from_revisions_;
}

grpc::Status Replay::CreateMesh(grpc::ServerContext*, const v1::CreateMeshRequest* request,
                                v1::Mesh* mesh) {
  mesh->set_name("meshes/recorded");
  *mesh->mutable_spec() = request->spec();
  mesh->mutable_spec()->set_boundary_only(TextAt(entry_, "only") == "boundary");
  return grpc::Status::OK;
}

grpc::Status Replay::DeleteMesh(grpc::ServerContext*, const v1::DeleteMeshRequest*,
                                google::protobuf::Empty*) {
  return grpc::Status::OK;
}

grpc::Status Replay::WatchMesh(grpc::ServerContext*, const v1::WatchMeshRequest* request,
                               grpc::ServerWriter<v1::WatchMeshResponse>* writer) {
  size_t attempt = 0;
  {
    const std::lock_guard lock(mutex_);
    attempt = from_revisions_.size();
    from_revisions_.push_back(request->from_revision());
  }
  if (attempt >= attempts_.size()) return {grpc::StatusCode::INTERNAL, "one stream too many"};
  for (const auto& message : ReadStream(TextAt(attempts_[attempt], "file"))) {
    writer->Write(message);
  }
  if (TextAt(attempts_[attempt], "then") == "UNAVAILABLE") {
    return {grpc::StatusCode::UNAVAILABLE, "the stream breaks here"};
  }
  const std::lock_guard lock(mutex_);
  over_ = true;
  wake_.notify_all();
  return grpc::Status::OK;
}

grpc::Status Replay::ServeOracle(
    grpc::ServerContext* context,
    grpc::ServerReaderWriter<v1::ServeOracleResponse, v1::ServeOracleRequest>* stream) {
  v1::ServeOracleResponse response;
  response.mutable_welcome()->set_dimension(
      static_cast<std::uint32_t>(NumberAt(entry_, "dimension")));
  response.mutable_welcome()->set_ambient_dimension(
      static_cast<std::uint32_t>(NumberAt(entry_, "ambient_dimension")));
  stream->Write(response);
  {
    std::unique_lock lock(mutex_);
    while (!over_ && !context->IsCancelled()) {
      wake_.wait_for(lock, std::chrono::milliseconds(10));
    }
  }
  response.mutable_over()->set_state("MESH_STATE_SUCCEEDED");
  stream->Write(response);
  return grpc::Status::OK;
}

}  // namespace stellate::testing
