#include "stellate/download.h"

#include <chrono>
#include <memory>
#include <optional>
#include <utility>

#include "net/channel.h"
#include "net/reconnect.h"
#include "run/delta_mesh.h"
#include "run/run.h"
#include "stellate/monitor.h"
#include "stellate/v1/stellate.grpc.pb.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate {
namespace client {
namespace {

// A mesh that was just cancelled is over, but its last round may be being computed still.
bool IsOver(const v1::Mesh& mesh) {
  return mesh.state() != v1::MESH_STATE_WAITING && mesh.state() != v1::MESH_STATE_RUNNING;
}
bool HasEnded(const v1::Mesh& mesh) { return IsOver(mesh) && mesh.has_end_time(); }

// One mesh on its way here.
class Download {
 public:
  Download(const std::shared_ptr<grpc::Channel>& channel, const std::string& name,
           const DownloadOptions& options)
      : stub_(v1::Stellate::NewStub(channel)),
        name_(name),
        options_(options),
        attempts_({options.connection.reconnect, channel,
                   /*hopeless=*/{}, options.connection.on_outage}) {}

  Expected<Mesh> Go() {
    const std::stop_callback cancel(options_.stop, [this] { attempts_.Stop(); });
    if (auto ok = Look(); !ok) return tl::unexpected(ok.error());
    const int k = SimplexDimension(status_.spec());
    const auto d = static_cast<int>(status_.spec().ambient_dimension());
    if (options_.on_found) {
      if (auto ok = options_.on_found(k, d); !ok) return tl::unexpected(ok.error());
    }
    if (options_.revision == 0) {
      if (auto ok = Settle(); !ok) return tl::unexpected(ok.error());
    }
    auto builder = DeltaMesh::Create(k, d, status_.spec().boundary_only());
    if (!builder) return tl::unexpected(builder.error());
    builder_ = std::make_unique<DeltaMesh>(std::move(*builder));
    if (auto ok = Fetch(); !ok) return tl::unexpected(ok.error());
    return Conclude();
  }

 private:
  // Not tried again: a server that cannot be reached in the first place is an error at once.
  Expected<void> Look() {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kCallTime);
    v1::GetMeshRequest request;
    request.set_name(name_);
    const grpc::Status status = stub_->GetMesh(&context, request, &status_);
    if (!status.ok()) return tl::unexpected(FromStatus(status));
    return {};
  }

  // The mesh is as it is to be fetched.
  Expected<void> Settle() {
    if (options_.unfinished == Unfinished::kTake) return {};
    if (options_.unfinished == Unfinished::kRefuse && !IsOver(status_)) {
      return tl::unexpected(NotOver());
    }
    if (!HasEnded(status_)) {
      if (auto ok = AwaitEnd(); !ok) return ok;
    }
    if (status_.state() == v1::MESH_STATE_FAILED) return tl::unexpected(WhyFailed(status_));
    return {};
  }

  Error NotOver() const {
    const v1::Progress& progress = status_.progress();
    return {ErrorCode::kRefused, "",
            name_ + " is not over: " + MeshStateName(static_cast<MeshState>(status_.state())) +
                ", round " + std::to_string(progress.round()) + ", " +
                std::to_string(progress.vertices()) +
                " vertices; wait for its end, or take it as it is"};
  }

  Expected<void> AwaitEnd() {
    v1::WatchMeshRequest request;
    request.set_name(name_);
    request.set_progress_only(true);
    grpc::Status status;
    do {
      const auto stream = stub_->WatchMesh(&attempts_.Attempt(), request);
      v1::WatchMeshResponse response;
      bool over = false;
      while (stream->Read(&response)) {
        attempts_.Heard();
        if (response.has_progress() && options_.on_progress) {
          options_.on_progress(FromProto(response.progress()));
        }
        if (response.has_final()) {
          status_.Swap(response.mutable_final());
          over = true;
        }
      }
      status = stream->Finish();
      if (over) return {};
    } while (attempts_.Again(status));
    return tl::unexpected(Lost(status));
  }

  Expected<void> Fetch() {
    v1::DownloadMeshRequest request;
    request.set_name(name_);
    request.set_revision(options_.revision);
    grpc::Status status;
    do {
      grpc::ClientContext& context = attempts_.Attempt();
      const auto stream = stub_->DownloadMesh(&context, request);
      v1::DownloadMeshResponse part;
      bool complete = false;
      while (stream->Read(&part)) {
        attempts_.Heard();
        complete = part.complete();
        request.set_revision(part.revision());
        request.set_position(part.next_position());
        vertices_ = part.vertices();
        simplices_ = part.simplices();
        auto ok = builder_->Add(std::move(part));
        if (ok && (builder_->vertices() > vertices_ || builder_->simplices() > simplices_))
          ok = tl::unexpected(BrokenProtocol("more of the mesh than it had announced"));
        if (!ok) {
          context.TryCancel();
          return ok;
        }
        if (options_.on_part) {
          options_.on_part(builder_->vertices() + builder_->simplices(), vertices_ + simplices_);
        }
      }
      status = stream->Finish();
      if (complete) {
        revision_ = request.revision();
        return {};
      }
    } while (attempts_.Again(status));
    return tl::unexpected(Lost(status));
  }

  Error Lost(const grpc::Status& status) const {
    if (options_.stop.stop_requested()) {
      return {ErrorCode::kStopped, "", "the download was stopped"};
    }
    if (status.ok()) return BrokenProtocol("the end of its stream too early");
    return attempts_.Lost(status);
  }

  Expected<Mesh> Conclude() {
    Expected<Mesh> mesh = builder_->Take();
    if (!mesh) return mesh;
    const auto vertices = static_cast<std::uint64_t>(mesh->points.cols());
    const auto simplices = static_cast<std::uint64_t>(mesh->simplices.cols());
    if (vertices != vertices_ || simplices != simplices_) {
      return tl::unexpected(
          BrokenProtocol(std::to_string(vertices) + " vertices and " + std::to_string(simplices) +
                         " simplices, after it had announced " + std::to_string(vertices_) +
                         " and " + std::to_string(simplices_)));
    }
    mesh->region_names.assign(status_.spec().region_names().begin(),
                              status_.spec().region_names().end());
    if (HasEnded(status_) && revision_ == status_.revision()) {
      mesh->report = ReportOf(status_);
    }
    return mesh;
  }

  const std::unique_ptr<v1::Stellate::Stub> stub_;
  const std::string name_;
  const DownloadOptions& options_;
  Reconnector attempts_;
  v1::Mesh status_;  // without geometry
  std::unique_ptr<DeltaMesh> builder_;
  std::uint64_t revision_ = 0, vertices_ = 0, simplices_ = 0;  // of what was fetched
};

}  // namespace
}  // namespace client

Expected<Mesh> DownloadMesh(const std::string& name, const DownloadOptions& options) {
  if (options.connection.server.empty()) {
    return Fail(ErrorCode::kRefused, "no server is given: say where the mesh is");
  }
  const auto channel = client::Connect(options.connection);
  if (!channel) return tl::unexpected(channel.error());
  return client::Download(*channel, name, options).Go();
}

}  // namespace stellate
