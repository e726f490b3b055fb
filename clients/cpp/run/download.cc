#include "stellate/download.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <utility>

#include "mesh/streamed_file.h"
#include "net/channel.h"
#include "net/reconnect.h"
#include "run/delta_mesh.h"
#include "run/download.h"
#include "run/part_files.h"
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
    if (auto ok = Begin({}); !ok) return tl::unexpected(ok.error());
    return FetchWhole();
  }

  Expected<SavedMesh> GoTo(const std::vector<std::string>& paths) {
    const std::stop_callback cancel(options_.stop, [this] { attempts_.Stop(); });
    if (auto ok = Begin(paths); !ok) return tl::unexpected(ok.error());
    if (paths.empty() && IsLast()) {
      const Report report = ReportOf(status_);
      return Saved(report, report.counts.vertices, report.counts.simplices, 0, {});
    }
    if (CanStream(paths)) {
      PartFiles files(paths, status_, ReportOf(status_));
      const Expected<bool> fetched = FetchInto(&files);
      if (!fetched) return tl::unexpected(fetched.error());
      if (*fetched)
        return Saved(ReportOf(status_), files.vertices(), files.simplices(), paths.size(),
                     files.Finish());
    }
    const Expected<Mesh> mesh = FetchWhole();
    if (!mesh) return tl::unexpected(mesh.error());
    std::vector<Error> failures;
    for (const std::string& path : paths) {
      if (const Expected<void> saved = mesh->Save(path); !saved) failures.push_back(saved.error());
    }
    return Saved(mesh->report, static_cast<std::uint64_t>(mesh->points.cols()),
                 static_cast<std::uint64_t>(mesh->simplices.cols()), paths.size(),
                 std::move(failures));
  }

 private:
  int k() const { return SimplexDimension(status_.spec()); }
  int d() const { return static_cast<int>(status_.spec().ambient_dimension()); }

  // Everything before the transfer.
  Expected<void> Begin(const std::vector<std::string>& paths) {
    if (auto ok = Look(); !ok) return ok;
    for (const std::string& path : paths) {
      if (auto ok = CheckSave(path, k(), d()); !ok) return ok;
    }
    return options_.revision ? Expected<void>() : Settle();
  }

  bool IsLast() const {
    return HasEnded(status_) &&
           options_.revision.value_or(status_.revision()) == status_.revision();
  }

  bool CanStream(const std::vector<std::string>& paths) const {
    return IsLast() && std::all_of(paths.begin(), paths.end(), [this](const std::string& path) {
             return client::CanStream(path, k(), d(), status_.spec().walls() > 0,
                                      status_.spec().boundary_only());
           });
  }

  Expected<SavedMesh> Saved(const Report& report, std::uint64_t vertices, std::uint64_t simplices,
                            std::size_t paths, std::vector<Error> failures) const {
    if (paths > 0 && failures.size() == paths) return tl::unexpected(std::move(failures.front()));
    return SavedMesh{k(), d(), vertices, simplices, report, std::move(failures)};
  }

  Expected<Mesh> FetchWhole() {
    auto builder = DeltaMesh::Create(k(), d(), status_.spec().boundary_only());
    if (!builder) return tl::unexpected(builder.error());
    builder_ = std::make_unique<DeltaMesh>(std::move(*builder));
    const auto add = [this](v1::DownloadMeshResponse&& part) -> Expected<bool> {
      if (auto ok = builder_->Add(std::move(part)); !ok) return tl::unexpected(ok.error());
      if (builder_->vertices() > vertices_ || builder_->simplices() > simplices_)
        return tl::unexpected(BrokenProtocol("more of the mesh than it had announced"));
      Tell(builder_->vertices() + builder_->simplices());
      return true;
    };
    if (const auto ok = Fetch(add); !ok) return tl::unexpected(ok.error());
    return Conclude();
  }

  // False: not what can be written as it comes.
  Expected<bool> FetchInto(PartFiles* files) {
    const auto take = [this, files](v1::DownloadMeshResponse&& part) -> Expected<bool> {
      if (part.revision() != status_.revision()) return false;
      const auto taken = files->Take(part);
      if (!taken) return tl::unexpected(taken.error());
      Tell(files->vertices() + files->simplices());
      return *taken == PartFiles::Taken::kYes;
    };
    Expected<bool> fetched = Fetch(take);
    if (!fetched || !*fetched) return fetched;
    if (auto ok = CheckSize(files->vertices(), files->simplices()); !ok)
      return tl::unexpected(ok.error());
    return files->WriteGroups();
  }

  void Tell(std::uint64_t received) const {
    if (options_.on_part) options_.on_part(received, vertices_ + simplices_);
  }

  Expected<void> CheckSize(std::uint64_t vertices, std::uint64_t simplices) const {
    if (vertices == vertices_ && simplices == simplices_) return {};
    return tl::unexpected(
        BrokenProtocol(std::to_string(vertices) + " vertices and " + std::to_string(simplices) +
                       " simplices, after it had announced " + std::to_string(vertices_) + " and " +
                       std::to_string(simplices_)));
  }

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

  // Gives each part to `add`, which returns whether it wants more of them: true if it always did.
  using Add = std::function<Expected<bool>(v1::DownloadMeshResponse&& part)>;
  Expected<bool> Fetch(const Add& add) {
    v1::DownloadMeshRequest request;
    request.set_name(name_);
    if (options_.revision) request.set_revision(*options_.revision);
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
        Expected<bool> more = add(std::move(part));
        if (!more || !*more) {
          context.TryCancel();
          return more;
        }
      }
      status = stream->Finish();
      if (complete) {
        revision_ = request.revision();
        return true;
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
    if (auto ok = CheckSize(static_cast<std::uint64_t>(mesh->points.cols()),
                            static_cast<std::uint64_t>(mesh->simplices.cols()));
        !ok) {
      return tl::unexpected(ok.error());
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
  v1::Mesh status_;                                            // without geometry
  std::unique_ptr<DeltaMesh> builder_;                         // of what is fetched whole
  std::uint64_t revision_ = 0, vertices_ = 0, simplices_ = 0;  // of what was fetched
};

Expected<std::shared_ptr<grpc::Channel>> ConnectFor(const DownloadOptions& options) {
  if (options.connection.server.empty()) {
    return Fail(ErrorCode::kRefused, "no server is given: say where the mesh is");
  }
  if (options.revision == 0) {
    return Fail(ErrorCode::kRefused,
                "revision is 0; they count from 1, and the newest one comes if none is given");
  }
  return Connect(options.connection);
}

}  // namespace

Expected<SavedMesh> DownloadTo(const std::shared_ptr<grpc::Channel>& channel,
                               const std::string& name, const std::vector<std::string>& paths,
                               const DownloadOptions& options) {
  return Download(channel, name, options).GoTo(paths);
}

}  // namespace client

Expected<Mesh> DownloadMesh(const std::string& name, const DownloadOptions& options) {
  const auto channel = client::ConnectFor(options);
  if (!channel) return tl::unexpected(channel.error());
  return client::Download(*channel, name, options).Go();
}

Expected<SavedMesh> DownloadMeshTo(const std::string& name, const std::vector<std::string>& paths,
                                   const DownloadOptions& options) {
  const auto channel = client::ConnectFor(options);
  if (!channel) return tl::unexpected(channel.error());
  return client::DownloadTo(*channel, name, paths, options);
}

}  // namespace stellate
