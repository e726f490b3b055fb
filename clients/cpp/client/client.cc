#include "stellate/client.h"

#include <google/protobuf/wrappers.pb.h>
#include <grpcpp/generic/generic_stub.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

#include "channel.h"
#include "convert.h"
#include "embedded_server.h"
#include "mesh_builder.h"
#include "worker.h"

namespace stellate {
namespace {

using client::FromProto;
using client::FromStatus;

constexpr auto kCallTime = std::chrono::seconds(30);     // for a unary call, connecting included
constexpr auto kHousekeeping = std::chrono::seconds(5);  // for calls that clean up

void SetDeadline(grpc::ClientContext& context, std::chrono::seconds time) {
  context.set_deadline(std::chrono::system_clock::now() + time);
}

// One mesh on one server, from its creation to its end.
class Run {
 public:
  Run(const std::shared_ptr<grpc::Channel>& channel, Oracle& oracle, const MeshOptions& options)
      : stub_(v1::Stellate::NewStub(channel)), oracle_(oracle), options_(options) {}

  // Whatever happens the mesh is gone from the server, and no thread is left in the oracle.
  ~Run() {
    if (!name_.empty()) {
      grpc::ClientContext context;
      SetDeadline(context, kHousekeeping);
      v1::DeleteMeshRequest request;
      request.set_name(name_);
      google::protobuf::Empty ignored;
      stub_->DeleteMesh(&context, request, &ignored);
    }
    StopWorkers();
  }

  Expected<Mesh> Go() {
    if (const Expected<void> created = Create(); !created) return tl::unexpected(created.error());
    StartWorkers();
    Expected<Mesh> mesh = [this] {
      const std::stop_callback cancel(options_.stop, [this] { Cancel(); });
      return Watch();
    }();
    const bool broken = !mesh.has_value() && !ended_;
    if (broken) {
      for (const auto& worker : workers_) worker->Stop();
    }
    JoinWorkers();
    for (const auto& worker : workers_) {
      if (worker->exception()) std::rethrow_exception(worker->exception());
    }
    // The mesh's own failure says most; a stream that the server refused says why it has none.
    if (broken) {
      for (const auto& worker : workers_) {
        if (worker->error() && (given_up_ || worker->error()->code != ErrorCode::kServerFailed)) {
          return tl::unexpected(*worker->error());
        }
      }
    }
    return mesh;
  }

 private:
  Expected<void> Create() {
    const Expected<v1::MeshSpec> spec = client::ToSpec(oracle_, options_);
    if (!spec) return tl::unexpected(spec.error());
    auto builder = client::MeshBuilder::Create(oracle_.dimension(), oracle_.ambient_dimension());
    if (!builder) return tl::unexpected(builder.error());
    builder_ = std::make_unique<client::MeshBuilder>(std::move(*builder));
    grpc::ClientContext context;
    SetDeadline(context, kCallTime);
    v1::CreateMeshRequest request;
    *request.mutable_spec() = *spec;
    v1::Mesh mesh;
    const grpc::Status status = stub_->CreateMesh(&context, request, &mesh);
    if (!status.ok()) return tl::unexpected(FromStatus(status));
    name_ = mesh.name();
    return {};
  }

  void StartWorkers() {
    for (int i = 0; i < options_.workers; ++i) {
      workers_.push_back(
          std::make_unique<client::Worker>(*stub_, oracle_, name_, "cpp-" + std::to_string(i + 1)));
    }
    for (const auto& worker : workers_) {
      threads_.emplace_back([this, w = worker.get()] {
        w->Run();
        WorkerEnded(*w);
      });
    }
  }

  // When the last worker is gone without the mesh being over nobody is left to answer.
  void WorkerEnded(const client::Worker& worker) {
    const std::lock_guard lock(mutex_);
    ++ended_workers_;
    if (worker.error() && ended_workers_ == workers_.size() &&
        worker.error()->code == ErrorCode::kServerFailed) {
      given_up_ = true;
      watch_context_.TryCancel();
    }
  }

  void JoinWorkers() {
    for (std::thread& thread : threads_) thread.join();
    threads_.clear();
  }

  void StopWorkers() {
    for (const auto& worker : workers_) worker->Stop();
    JoinWorkers();
  }

  void Cancel() {
    grpc::ClientContext context;
    SetDeadline(context, kHousekeeping);
    v1::CancelMeshRequest request;
    request.set_name(name_);
    v1::Mesh ignored;
    stub_->CancelMesh(&context, request, &ignored);
  }

  // Reads the mesh to its end. Sets ended_ when the server said how it ended.
  Expected<Mesh> Watch() {
    v1::WatchMeshRequest request;
    request.set_name(name_);
    const auto stream = stub_->WatchMesh(&watch_context_, request);
    v1::WatchMeshResponse response;
    v1::Mesh final;
    while (stream->Read(&response)) {
      if (response.has_delta()) {
        if (const auto ok = builder_->Absorb(response.delta().delta()); !ok) {
          watch_context_.TryCancel();
          return tl::unexpected(ok.error());
        }
      } else if (response.has_progress()) {
        if (options_.on_progress) options_.on_progress(FromProto(response.progress()));
      } else if (response.has_final()) {
        final = response.final();
        ended_ = true;
      }
    }
    const grpc::Status status = stream->Finish();
    if (!ended_) {
      if (status.ok())
        return Fail(ErrorCode::kServerFailed, "the server ended the watch too early");
      if (status.error_code() == grpc::StatusCode::CANCELLED) {
        return Fail(ErrorCode::kServerFailed, "the server broke off");
      }
      return tl::unexpected(FromStatus(status));
    }
    return Conclude(final);
  }

  Expected<Mesh> Conclude(const v1::Mesh& final) {
    if (final.state() == v1::MESH_STATE_FAILED) {
      const v1::Failure& failure = final.report().failure();
      const bool oracle = failure.reason().rfind("ORACLE_", 0) == 0 ||
                          failure.reason() == "ANSWER_TIMEOUT" || failure.reason() == "NO_SEEDS";
      return Fail(oracle ? ErrorCode::kOracleFailed : ErrorCode::kServerFailed, failure.message(),
                  failure.reason());
    }
    Expected<Mesh> mesh = builder_->Take();
    if (!mesh) return mesh;
    mesh->report = FromProto(final.report());
    const Counts& counts = mesh->report.counts;
    if (counts.vertices != static_cast<std::uint64_t>(mesh->points.cols()) ||
        counts.simplices != static_cast<std::uint64_t>(mesh->simplices.cols())) {
      return Fail(ErrorCode::kServerFailed,
                  "the server reports " + std::to_string(counts.vertices) + " vertices and " +
                      std::to_string(counts.simplices) + " simplices but sent " +
                      std::to_string(mesh->points.cols()) + " and " +
                      std::to_string(mesh->simplices.cols()));
    }
    return mesh;
  }

  const std::unique_ptr<v1::Stellate::Stub> stub_;
  Oracle& oracle_;
  const MeshOptions& options_;
  std::string name_;
  std::unique_ptr<client::MeshBuilder> builder_;
  grpc::ClientContext watch_context_;
  bool ended_ = false;
  std::vector<std::unique_ptr<client::Worker>> workers_;
  std::vector<std::thread> threads_;
  std::mutex mutex_;
  size_t ended_workers_ = 0;
  bool given_up_ = false;  // the last worker lost the server
};

}  // namespace

Expected<Mesh> MeshManifold(Oracle& oracle, const MeshOptions& options) {
  std::unique_ptr<client::EmbeddedServer> embedded;
  std::string server = options.server;
  if (server.empty()) {
    auto started = client::EmbeddedServer::Start();
    if (!started) return tl::unexpected(started.error());
    embedded = std::move(*started);
    server = embedded->address();
  }
  const auto channel =
      client::Connect(server, options.server.empty() ? Credentials() : options.credentials);
  if (!channel) return tl::unexpected(channel.error());
  Run run(*channel, oracle, options);
  return run.Go();
}

Expected<ServerHealth> CheckHealth(const std::string& server, double timeout_seconds,
                                   const Credentials& credentials) {
  const auto connected = client::Connect(server, credentials);
  if (!connected) return tl::unexpected(connected.error());
  const std::shared_ptr<grpc::Channel>& channel = *connected;
  const auto deadline = std::chrono::system_clock::now() +
                        std::chrono::duration_cast<std::chrono::system_clock::duration>(
                            std::chrono::duration<double>(timeout_seconds));
  ServerHealth health;
  {
    // HealthCheckRequest { string service = 1 } and HealthCheckResponse { enum status = 1 } are on
    // the wire what StringValue and UInt32Value are.
    grpc::ClientContext context;
    context.set_deadline(deadline);
    const google::protobuf::StringValue request;  // "": the server as a whole
    google::protobuf::UInt32Value response;
    std::mutex mutex;
    std::condition_variable done;
    std::optional<grpc::Status> status;
    grpc::TemplatedGenericStub<google::protobuf::StringValue, google::protobuf::UInt32Value> stub(
        channel);
    stub.UnaryCall(&context, "/grpc.health.v1.Health/Check", grpc::StubOptions(), &request,
                   &response, [&](const grpc::Status& result) {
                     const std::lock_guard lock(mutex);
                     status = result;
                     done.notify_one();
                   });
    std::unique_lock lock(mutex);
    done.wait(lock, [&] { return status.has_value(); });
    if (!status->ok()) return tl::unexpected(FromStatus(*status));
    constexpr std::uint32_t kServing = 1;
    health.serving = response.value() == kServing;
  }
  grpc::ClientContext context;
  context.set_deadline(deadline);
  v1::ServerInfo info;
  const grpc::Status status =
      v1::Stellate::NewStub(channel)->GetServerInfo(&context, v1::GetServerInfoRequest(), &info);
  if (!status.ok()) return tl::unexpected(FromStatus(status));
  health.version = info.version();
  health.protocols.assign(info.protocols().begin(), info.protocols().end());
  health.max_dimension = info.max_dimension();
  health.max_ambient_dimension = info.max_ambient_dimension();
  health.max_meshes = info.max_meshes();
  health.max_vertices = info.max_vertices();
  health.max_rounds = info.max_rounds();
  health.max_message_bytes = info.max_message_bytes();
  return health;
}

}  // namespace stellate
