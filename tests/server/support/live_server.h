#pragma once

#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "server/convert/arrays.h"
#include "server/convert/spec.h"
#include "server/server.h"
#include "stellate/v1/stellate.grpc.pb.h"
#include "tests/server/support/sphere.h"
#include "tests/server/support/status_matchers.h"

namespace stellate::server::testing {

// A server in this process, on a unix socket of its own or a port, and raw stubs to it.
class LiveServer : public ::testing::Test {
 protected:
  using Stream = grpc::ClientReaderWriter<v1::ServeOracleRequest, v1::ServeOracleResponse>;

  void Start(Config config = {}) {
    static std::atomic<int> count{0};
    config.listen = "unix:" + ::testing::TempDir() + "stellate-" + std::to_string(getpid()) + "-" +
                    std::to_string(count++);
    StartAsTold(config);
  }

  // On a port of the loopback.
  void StartTcp(Config config = {}) {
    config.listen = "127.0.0.1:0";
    StartAsTold(config);
  }

  int port() const {
    const std::string& address = server_->address();
    return std::stoi(address.substr(address.find(':') + 1));
  }

  void StartAsTold(const Config& config) {
    auto server = Server::Start(config);
    ASSERT_TRUE(server) << server.error().message;
    server_ = std::move(*server);
    stub_ = NewStub();
  }

  // On a connection of its own.
  std::unique_ptr<v1::Stellate::Stub> NewStub() {
    grpc::ChannelArguments arguments;
    arguments.SetInt("grpc.use_local_subchannel_pool", 1);
    arguments.SetMaxReceiveMessageSize(-1);
    return v1::Stellate::NewStub(grpc::CreateCustomChannel(
        server_->address(), grpc::InsecureChannelCredentials(), arguments));
  }

  static v1::MeshSpec SpecOfSphere(double epsilon = 0.3) {
    v1::MeshSpec spec;
    ToProto(SphereSpec(epsilon), &spec);
    spec.clear_limits();
    return spec;
  }

  grpc::Status Create(const v1::MeshSpec& spec, v1::Mesh* mesh) {
    grpc::ClientContext context;
    v1::CreateMeshRequest request;
    *request.mutable_spec() = spec;
    return stub_->CreateMesh(&context, request, mesh);
  }

  // Under an id of the client's own.
  grpc::Status Create(const v1::MeshSpec& spec, const std::string& id, v1::Mesh* mesh) {
    grpc::ClientContext context;
    v1::CreateMeshRequest request;
    *request.mutable_spec() = spec;
    request.set_mesh_id(id);
    return stub_->CreateMesh(&context, request, mesh);
  }

  std::string CreateSphere(double epsilon = 0.3) {
    v1::Mesh mesh;
    const grpc::Status status = Create(SpecOfSphere(epsilon), &mesh);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return mesh.name();
  }

  v1::Mesh Get(const std::string& name) {
    grpc::ClientContext context;
    v1::GetMeshRequest request;
    request.set_name(name);
    v1::Mesh mesh;
    EXPECT_TRUE(stub_->GetMesh(&context, request, &mesh).ok());
    return mesh;
  }

  // Watches to the end and returns the final message.
  v1::Mesh WatchToEnd(const std::string& name) {
    grpc::ClientContext context;
    v1::WatchMeshRequest request;
    request.set_name(name);
    request.set_progress_only(true);
    const auto reader = stub_->WatchMesh(&context, request);
    v1::WatchMeshResponse event;
    v1::Mesh final;
    while (reader->Read(&event)) {
      if (event.has_final()) final = event.final();
    }
    const grpc::Status status = reader->Finish();
    EXPECT_TRUE(status.ok()) << status.error_message();
    return final;
  }

  std::unique_ptr<Server> server_;
  std::unique_ptr<v1::Stellate::Stub> stub_;
};

// A true answer to a chunk about the sphere.
inline v1::AnswerChunk TrueAnswer(const v1::QueryChunk& queries) {
  const auto n = static_cast<Eigen::Index>(queries.points().shape(0));
  core::QueryBlock block;
  block.points = MatrixFromProto(queries.points(), 3, n);
  block.want.tangents = queries.want_tangents();
  if (queries.kind() == v1::QUERY_KIND_INTERSECT_FLAT) {
    block.kind = core::QueryKind::kIntersectFlat;
    block.bases = MatrixFromProto(queries.bases(), 6, n);
    block.radii = MatrixFromProto(queries.radii(), n, 1);
  }
  const core::AnswerBlock answer = AnswerSphere(block, 0, n);
  v1::AnswerChunk out;
  out.set_lease(queries.lease());
  const auto count = static_cast<std::size_t>(n);
  ToProto(answer.points.data(), {count, 3}, out.mutable_points());
  out.set_found(std::string(answer.found.begin(), answer.found.end()));
  if (block.want.tangents) {
    ToProto(answer.tangents.data(), {count, 3, 2}, out.mutable_tangents());
  }
  return out;
}

// Overwrites number `i` of an array.
inline void Poke(v1::Array* array, std::size_t i, double value) {
  std::memcpy(array->mutable_data()->data() + i * sizeof(double), &value, sizeof(double));
}

// A worker on a stream, answering from a thread of its own until the stream ends.
class RawWorker {
 public:
  // What to answer; nothing: leave the chunk unanswered.
  using Answer = std::function<std::optional<v1::ServeOracleRequest>(const v1::QueryChunk&)>;

  static std::optional<v1::ServeOracleRequest> Truly(const v1::QueryChunk& queries) {
    v1::ServeOracleRequest request;
    *request.mutable_answers() = TrueAnswer(queries);
    return request;
  }

  RawWorker(v1::Stellate::Stub* stub, const std::string& mesh, Answer answer = Truly)
      : answer_(std::move(answer)), stream_(stub->ServeOracle(&context_)) {
    v1::ServeOracleRequest hello;
    hello.mutable_hello()->set_mesh(mesh);
    hello.mutable_hello()->set_worker("test");
    stream_->Write(hello);
    thread_ = std::thread([this] { Serve(); });
  }

  ~RawWorker() {
    context_.TryCancel();
    if (thread_.joinable()) thread_.join();
  }

  // How the stream ended.
  grpc::Status Wait() {
    thread_.join();
    return status_;
  }
  void Vanish() { context_.TryCancel(); }
  void SayNoMore() { stream_->WritesDone(); }

  std::string over() const { return over_; }  // after Wait
  int chunks() const { return chunks_; }

 private:
  void Serve() {
    v1::ServeOracleResponse response;
    while (stream_->Read(&response)) {
      if (response.has_over()) over_ = response.over().state();
      if (!response.has_queries()) continue;
      ++chunks_;
      const auto request = answer_(response.queries());
      if (request) stream_->Write(*request);
    }
    status_ = stream_->Finish();
  }

  const Answer answer_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::ServeOracleRequest, v1::ServeOracleResponse>>
      stream_;
  std::atomic<int> chunks_{0};
  std::string over_;
  grpc::Status status_;
  std::thread thread_;
};

}  // namespace stellate::server::testing
