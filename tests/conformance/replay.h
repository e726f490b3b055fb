#pragma once

#include <grpcpp/server.h>

#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "files.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::testing {

// A server that makes one mesh, and sends the watch streams of an entry of streams.json in turn.
class Replay final : public v1::Stellate::Service {
 public:
  explicit Replay(const Entry& entry);
  ~Replay() override;

  const std::string& address() const { return address_; }
  // What the streams were asked for with.
  std::vector<std::uint64_t> from_revisions();

  grpc::Status CreateMesh(grpc::ServerContext*, const v1::CreateMeshRequest*, v1::Mesh*) override;
  grpc::Status DeleteMesh(grpc::ServerContext*, const v1::DeleteMeshRequest*,
                          google::protobuf::Empty*) override;
  grpc::Status WatchMesh(grpc::ServerContext*, const v1::WatchMeshRequest*,
                         grpc::ServerWriter<v1::WatchMeshResponse>*) override;
  // A worker is asked nothing, and told when the mesh is over.
  grpc::Status ServeOracle(
      grpc::ServerContext*,
      grpc::ServerReaderWriter<v1::ServeOracleResponse, v1::ServeOracleRequest>*) override;

 private:
  const Entry entry_;
  const std::vector<Entry> attempts_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::vector<std::uint64_t> from_revisions_;
  bool over_ = false;
  std::string address_;
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace stellate::testing
