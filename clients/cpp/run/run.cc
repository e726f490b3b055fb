#include "run/run.h"

#include <google/protobuf/empty.pb.h>

#include <chrono>
#include <stop_token>
#include <utility>

#include "run/declare.h"
#include "run/download.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate::client {
namespace {

constexpr auto kHousekeeping = std::chrono::seconds(5);  // for calls that clean up

void SetDeadline(grpc::ClientContext& context) {
  context.set_deadline(std::chrono::system_clock::now() + kHousekeeping);
}

}  // namespace

Run::Run(const std::shared_ptr<grpc::Channel>& channel, Oracle& oracle, const MeshOptions& options,
         std::function<bool()> hopeless, Watching watching)
    : channel_(channel),
      stub_(v1::Stellate::NewStub(channel)),
      oracle_(oracle),
      options_(options),
      hopeless_(std::move(hopeless)),
      watching_(watching) {
  ReconnectPolicy policy = Policy();
  policy.on_outage = options.connection.on_outage;
  watch_ = std::make_unique<Reconnector>(std::move(policy));
}

Run::~Run() {
  if (!name_.empty()) {
    grpc::ClientContext context;
    SetDeadline(context);
    context.set_wait_for_ready(ended_);  // unless the server is lost, it may be just coming back
    v1::DeleteMeshRequest request;
    request.set_name(name_);
    google::protobuf::Empty ignored;
    stub_->DeleteMesh(&context, request, &ignored);
  }
  for (const auto& worker : workers_) worker->Stop();
  JoinWorkers();
}

ReconnectPolicy Run::Policy() const {
  return {options_.connection.reconnect, channel_, hopeless_, {}};
}

Expected<Mesh> Run::Go() {
  if (const Expected<void> created = Create(); !created) return tl::unexpected(created.error());
  StartWorkers();
  Expected<Mesh> mesh = [this] {
    const std::stop_callback cancel(options_.stop, [this] { Cancel(); });
    return Watch();
  }();
  const bool broken = !mesh.has_value() && !ended_;
  const bool given_up = [this] {
    const std::lock_guard lock(mutex_);
    return given_up_;
  }();
  for (const auto& worker : workers_) {
    if (broken) {
      worker->Stop();
    } else {
      worker->Finish();
    }
  }
  JoinWorkers();
  // An oracle that fails while it is being stopped does not take the mesh so far away.
  const bool delivered = mesh.has_value() && options_.stop.stop_requested();
  for (const auto& worker : workers_) {
    if (worker->exception() && !delivered) std::rethrow_exception(worker->exception());
  }
  // The mesh's own failure says most; a stream that the server refused says why it has none.
  if (broken) {
    for (const auto& worker : workers_) {
      if (worker->error() && (given_up || worker->error()->code != ErrorCode::kServerFailed)) {
        return tl::unexpected(*worker->error());
      }
    }
  }
  return mesh;
}

Expected<void> Run::Create() {
  // What no client could hold is refused before there is a mesh.
  auto builder = DeltaMesh::Create(oracle_.dimension(), oracle_.ambient_dimension());
  if (!builder) return tl::unexpected(builder.error());
  ReconnectPolicy policy = Policy();
  policy.on_outage = options_.connection.on_outage;
  const Expected<v1::Mesh> mesh = CreateMesh(*stub_, oracle_, options_, policy);
  if (!mesh) return tl::unexpected(mesh.error());
  name_ = mesh->name();
  builder = DeltaMesh::Create(SimplexDimension(mesh->spec()), oracle_.ambient_dimension(),
                              mesh->spec().boundary_only());
  if (!builder) return tl::unexpected(builder.error());
  if (watching_ == Watching::kMesh) builder_ = std::make_unique<DeltaMesh>(std::move(*builder));
  return {};
}

void Run::StartWorkers() {
  for (int i = 0; i < options_.workers; ++i) {
    workers_.push_back(std::make_unique<Worker>(
        *stub_, oracle_, name_, "cpp-" + std::to_string(i + 1), Policy(), options_.max_chunk));
  }
  for (const auto& worker : workers_) {
    threads_.emplace_back([this, w = worker.get()] {
      w->Run();
      WorkerEnded(*w);
    });
  }
}

// When the last worker is gone before the mesh is over, nobody is left to answer.
void Run::WorkerEnded(const Worker& worker) {
  const std::lock_guard lock(mutex_);
  ++ended_workers_;
  if (worker.error() && ended_workers_ == workers_.size() &&
      worker.error()->code == ErrorCode::kServerFailed) {
    given_up_ = true;
    watch_->Stop();
  }
}

void Run::JoinWorkers() {
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

void Run::Cancel() {
  grpc::ClientContext context;
  SetDeadline(context);
  v1::CancelMeshRequest request;
  request.set_name(name_);
  v1::Mesh ignored;
  // A server that is away cannot say how the mesh ends: do not wait for it.
  if (!stub_->CancelMesh(&context, request, &ignored).ok()) watch_->Stop();
}

// One stream. Sets ended_ when the server said how the mesh ended. Errors: a stream that makes no
// sense; how it broke off is its status.
Expected<void> Run::WatchOnce(v1::Mesh* final, grpc::Status* status) {
  v1::WatchMeshRequest request;
  request.set_name(name_);
  request.set_progress_only(builder_ == nullptr);
  if (builder_ != nullptr) request.set_from_revision(builder_->revision());
  grpc::ClientContext& context = watch_->Attempt();
  const auto stream = stub_->WatchMesh(&context, request);
  v1::WatchMeshResponse response;
  while (stream->Read(&response)) {
    watch_->Heard();
    if (builder_ == nullptr && !response.has_progress() && !response.has_final()) continue;
    if (response.has_delta()) {
      if (auto ok = builder_->Absorb(std::move(*response.mutable_delta())); !ok) {
        context.TryCancel();
        return ok;
      }
    } else if (response.has_reset_mesh()) {
      builder_->Reset();
    } else if (response.has_orientation()) {
      if (auto ok = builder_->Orient(response.orientation()); !ok) {
        context.TryCancel();
        return ok;
      }
    } else if (response.has_progress()) {
      if (options_.on_progress) options_.on_progress(FromProto(response.progress()));
    } else if (response.has_final()) {
      final->Swap(response.mutable_final());
      ended_ = true;
    }
  }
  *status = stream->Finish();
  if (builder_ != nullptr) builder_->ForgetPending();
  return {};
}

// Reads the mesh to its end.
Expected<Mesh> Run::Watch() {
  v1::Mesh final;
  grpc::Status status;
  do {
    if (auto ok = WatchOnce(&final, &status); !ok) return tl::unexpected(ok.error());
    if (ended_) return Conclude(final);
  } while (watch_->Again(status));
  if (status.ok()) {
    return tl::unexpected(BrokenProtocol("the end of the watch too early"));
  }
  return tl::unexpected(LostFor(status));
}

// What to say when a watch cannot be carried on.
Error Run::LostFor(const grpc::Status& status) const {
  const bool cancelled = watch_->stopped() && options_.stop.stop_requested();
  if (!cancelled || status.error_code() == grpc::StatusCode::NOT_FOUND) return watch_->Lost(status);
  Error error = Explain(status, watch_->reconnecting());
  error.message = "cancelled while the server was away: " + error.message;
  return error;
}

Expected<Mesh> Run::Conclude(const v1::Mesh& final) {
  if (final.state() == v1::MESH_STATE_FAILED) return tl::unexpected(WhyFailed(final));
  if (builder_ == nullptr) {
    Mesh reported;
    reported.report = ReportOf(final);
    return reported;
  }
  Expected<Mesh> mesh = builder_->Take();
  if (!mesh) return mesh;
  mesh->report = ReportOf(final);
  mesh->region_names.assign(final.spec().region_names().begin(), final.spec().region_names().end());
  const Counts& counts = mesh->report.counts;
  if (counts.vertices != static_cast<std::uint64_t>(mesh->points.cols()) ||
      counts.simplices != static_cast<std::uint64_t>(mesh->simplices.cols())) {
    return tl::unexpected(BrokenProtocol(
        "a report of " + std::to_string(counts.vertices) + " vertices and " +
        std::to_string(counts.simplices) + " simplices, and a mesh of " +
        std::to_string(mesh->points.cols()) + " and " + std::to_string(mesh->simplices.cols())));
  }
  return mesh;
}

Expected<SavedMesh> Run::SaveTo(const std::vector<std::string>& paths) const {
  DownloadOptions options;
  options.connection = options_.connection;
  options.unfinished = Unfinished::kWait;  // it is over, but may be being put down still
  options.on_part = options_.on_part;
  if (!options_.stop.stop_requested())
    options.stop = options_.stop;  // else that has ended the mesh
  return DownloadTo(channel_, name_, paths, options);
}

}  // namespace stellate::client
