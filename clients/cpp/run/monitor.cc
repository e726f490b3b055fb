#include "stellate/monitor.h"

#include <google/protobuf/wrappers.pb.h>
#include <grpcpp/generic/generic_stub.h>

#include <chrono>
#include <condition_variable>
#include <iterator>
#include <mutex>
#include <optional>
#include <utility>

#include "net/channel.h"
#include "stellate/v1/stellate.grpc.pb.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate {
namespace {

using client::FromStatus;
using Deadline = std::chrono::system_clock::time_point;

Deadline After(Seconds wait) {
  return std::chrono::system_clock::now() +
         std::chrono::duration_cast<std::chrono::system_clock::duration>(wait);
}

}  // namespace

const char* MeshStateName(MeshState state) {
  constexpr const char* kNames[] = {"UNKNOWN", "WAITING",   "RUNNING", "SUCCEEDED",
                                    "STOPPED", "CANCELLED", "FAILED"};
  const size_t i = static_cast<size_t>(state);
  return i < std::size(kNames) ? kNames[i] : kNames[0];
}

class Monitor::Impl {
 public:
  explicit Impl(const std::shared_ptr<grpc::Channel>& channel)
      : health_(channel), stub_(v1::Stellate::NewStub(channel)) {}

  // HealthCheckRequest { string service = 1 } and HealthCheckResponse { enum status = 1 } are on
  // the wire what StringValue and UInt32Value are.
  Expected<bool> Serving(Deadline deadline) {
    grpc::ClientContext context;
    context.set_deadline(deadline);
    const google::protobuf::StringValue request;  // "": the server as a whole
    google::protobuf::UInt32Value response;
    std::mutex mutex;
    std::condition_variable done;
    std::optional<grpc::Status> status;
    health_.UnaryCall(&context, "/grpc.health.v1.Health/Check", grpc::StubOptions(), &request,
                      &response, [&](const grpc::Status& result) {
                        const std::lock_guard lock(mutex);
                        status = result;
                        done.notify_one();
                      });
    std::unique_lock lock(mutex);
    done.wait(lock, [&] { return status.has_value(); });
    if (!status->ok()) return tl::unexpected(FromStatus(*status));
    constexpr std::uint32_t kServing = 1;
    return response.value() == kServing;
  }

  Expected<ServerHealth> Health(Deadline deadline) {
    const Expected<bool> serving = Serving(deadline);
    if (!serving) return tl::unexpected(serving.error());
    grpc::ClientContext context;
    context.set_deadline(deadline);
    v1::ServerInfo info;
    const grpc::Status status = stub_->GetServerInfo(&context, v1::GetServerInfoRequest(), &info);
    if (!status.ok()) return tl::unexpected(FromStatus(status));
    ServerHealth health = client::HealthOf(info);
    health.serving = *serving;
    return health;
  }

  Expected<std::vector<MeshStatus>> Meshes(Deadline deadline) {
    std::vector<MeshStatus> meshes;
    v1::ListMeshesRequest request;
    do {
      grpc::ClientContext context;
      context.set_deadline(deadline);
      v1::ListMeshesResponse page;
      const grpc::Status status = stub_->ListMeshes(&context, request, &page);
      if (!status.ok()) return tl::unexpected(FromStatus(status));
      for (const v1::Mesh& mesh : page.meshes()) meshes.push_back(client::StatusOf(mesh));
      request.set_page_token(page.next_page_token());
    } while (!request.page_token().empty());
    return meshes;
  }

  Expected<void> Cancel(const std::string& name, Deadline deadline) {
    v1::CancelMeshRequest request;
    request.set_name(name);
    grpc::ClientContext context;
    context.set_deadline(deadline);
    v1::Mesh mesh;
    return DoneOr(stub_->CancelMesh(&context, request, &mesh));
  }
  Expected<void> Delete(const std::string& name, Deadline deadline) {
    v1::DeleteMeshRequest request;
    request.set_name(name);
    grpc::ClientContext context;
    context.set_deadline(deadline);
    google::protobuf::Empty nothing;
    return DoneOr(stub_->DeleteMesh(&context, request, &nothing));
  }

 private:
  static Expected<void> DoneOr(const grpc::Status& status) {
    if (!status.ok()) return tl::unexpected(FromStatus(status));
    return {};
  }

  grpc::TemplatedGenericStub<google::protobuf::StringValue, google::protobuf::UInt32Value> health_;
  const std::unique_ptr<v1::Stellate::Stub> stub_;
};

Monitor::Monitor(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Monitor::Monitor(Monitor&&) noexcept = default;
Monitor::~Monitor() = default;

Expected<Monitor> Monitor::Connect(const Connection& connection) {
  const auto channel = client::Connect(connection);
  if (!channel) return tl::unexpected(channel.error());
  return Monitor(std::make_unique<Impl>(*channel));
}

Expected<ServerHealth> Monitor::Health(Seconds timeout) { return impl_->Health(After(timeout)); }

Expected<std::vector<MeshStatus>> Monitor::Meshes(Seconds timeout) {
  return impl_->Meshes(After(timeout));
}

Expected<void> Monitor::Cancel(const std::string& name, Seconds timeout) {
  return impl_->Cancel(name, After(timeout));
}

Expected<void> Monitor::Delete(const std::string& name, Seconds timeout) {
  return impl_->Delete(name, After(timeout));
}

}  // namespace stellate
