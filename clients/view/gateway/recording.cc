#include "recording.h"

#include <grpcpp/client_context.h>
#include <openssl/evp.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include "mesh/write_file.h"
#include "net/channel.h"
#include "page.h"
#include "stellate/v1/stellate.grpc.pb.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate::view {
namespace {

// Of earlier revisions: as much as the mesh itself, within these.
constexpr double kLeastBytes = 1.2e6;
constexpr double kMostBytes = 16e6;
constexpr std::size_t kMostFileBytes = std::size_t{500} << 20;  // a browser's longest text
constexpr std::chrono::seconds kSilence{60};

std::string Base64(const std::string& bytes) {
  std::string text(4 * ((bytes.size() + 2) / 3) + 1, '\0');  // and a zero
  const int size = EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                                   reinterpret_cast<const unsigned char*>(bytes.data()),
                                   static_cast<int>(bytes.size()));
  text.resize(static_cast<size_t>(size));
  return text;
}

// A server says how a mesh is every second; one that says nothing for long is given up.
class Patience {
 public:
  explicit Patience(grpc::ClientContext& context)
      : thread_([this, &context](const std::stop_token& stop) {
          std::unique_lock lock(mutex_);
          while (!stop.stop_requested()) {
            heard_ = false;
            if (wake_.wait_for(lock, stop, kSilence, [this] { return heard_; })) continue;
            if (stop.stop_requested()) return;
            over_ = true;
            context.TryCancel();
            return;
          }
        }) {}

  void Heard() {
    const std::lock_guard lock(mutex_);
    heard_ = true;
    wake_.notify_one();
  }
  bool IsOver() const { return over_; }

 private:
  std::mutex mutex_;
  std::condition_variable_any wake_;
  bool heard_ = false;
  std::atomic<bool> over_{false};
  std::jthread thread_;
};

class Recorder {
 public:
  Recorder(const std::shared_ptr<grpc::Channel>& channel, std::string mesh,
           const RecordOptions& options)
      : stub_(v1::Stellate::NewStub(channel)), mesh_(std::move(mesh)), options_(options) {}

  Expected<std::string> Go() {
    if (const auto ok = Watch(); !ok) return tl::unexpected(ok.error());
    if (const auto ok = Look(); !ok) return tl::unexpected(ok.error());
    for (const std::uint64_t revision : Revisions()) {
      if (const auto ok = Download(revision); !ok) return tl::unexpected(ok.error());
    }
    // No names of servers or paths in a file that goes around.
    return "{\"replies\":[" + replies_ + "]}";
  }

 private:
  void Begin(const std::string& method, std::uint64_t revision = 0) {
    if (!replies_.empty()) replies_ += ",";
    replies_ += "{\"method\":\"" + method + "\",";
    if (revision > 0) replies_ += "\"revision\":" + std::to_string(revision) + ",";
    replies_ += "\"frames\":[";
    first_ = true;
  }
  template <typename Message>
  void Add(const Message& message) {
    replies_ += first_ ? "\"" : ",\"";
    replies_ += Base64(message.SerializeAsString());
    replies_ += "\"";
    first_ = false;
  }
  void End() { replies_ += "]}"; }
  bool IsTooLarge() const { return replies_.size() > kMostFileBytes; }

  // The name opens the mesh on its server, which a file that goes around should not.
  static void Anonymize(v1::Mesh* mesh) { mesh->set_name("meshes/recorded"); }

  template <typename Request, typename Response, typename Call, typename Take>
  Expected<void> Read(const Request& request, const Call& call, const Take& take) {
    grpc::ClientContext context;
    const std::stop_callback cancel(options_.stop, [&context] { context.TryCancel(); });
    Patience patience(context);
    const auto stream = call(&context, request);
    Response response;
    while (!IsTooLarge() && stream->Read(&response)) {
      patience.Heard();
      take(&response);
    }
    if (IsTooLarge()) context.TryCancel();
    const grpc::Status status = stream->Finish();
    if (options_.stop.stop_requested()) return Fail(ErrorCode::kStopped, "nothing was written");
    if (patience.IsOver()) {
      return Fail(ErrorCode::kServerFailed,
                  "the server said nothing for " + std::to_string(kSilence.count()) + " seconds",
                  "PROTOCOL");
    }
    if (IsTooLarge()) {
      return Fail(ErrorCode::kServerFailed,
                  "a file with this mesh would have more than " +
                      std::to_string(kMostFileBytes >> 20) +
                      " MB, which no browser opens: fetch it by `stellate download`",
                  "LIMIT_EXCEEDED");
    }
    if (!status.ok()) return tl::unexpected(client::FromStatus(status));
    return {};
  }

  // Waits for the end; what has been until now comes merged.
  Expected<void> Watch() {
    v1::WatchMeshRequest request;
    request.set_name(mesh_);
    request.set_progress_only(true);
    const auto watch = [this](auto* context, const auto& r) {
      return stub_->WatchMesh(context, r);
    };
    auto ok = Read<v1::WatchMeshRequest, v1::WatchMeshResponse>(
        request, watch, [this](v1::WatchMeshResponse* response) {
          if (response->has_progress() && options_.on_progress)
            options_.on_progress(client::FromProto(response->progress()));
        });
    if (!ok) return ok;
    request.set_progress_only(false);
    Begin("WatchMesh");
    auto whole = Read<v1::WatchMeshRequest, v1::WatchMeshResponse>(
        request, watch, [this](v1::WatchMeshResponse* response) {
          if (response->has_final()) Anonymize(response->mutable_final());
          if (response->has_delta() || response->has_orientation() || response->has_final())
            Add(*response);
        });
    End();
    return whole;
  }

  Expected<void> Look() {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + client::kCallTime);
    const std::stop_callback cancel(options_.stop, [&context] { context.TryCancel(); });
    v1::GetMeshRequest request;
    request.set_name(mesh_);
    request.set_past_progress_after(0);
    const grpc::Status status = stub_->GetMesh(&context, request, &status_);
    if (!status.ok()) return tl::unexpected(client::FromStatus(status));
    Anonymize(&status_);
    Begin("GetMesh");
    Add(status_);
    End();
    return {};
  }

  Expected<void> Download(std::uint64_t revision) {
    v1::DownloadMeshRequest request;
    request.set_name(mesh_);
    request.set_revision(revision);
    Begin("DownloadMesh", revision);
    auto ok = Read<v1::DownloadMeshRequest, v1::DownloadMeshResponse>(
        request, [this](auto* context, const auto& r) { return stub_->DownloadMesh(context, r); },
        [this](v1::DownloadMeshResponse* part) {
          part->clear_points();  // the first of those that the newest revision has
          Add(*part);
        });
    End();
    return ok;
  }

  // Those at which something came, as many as fit.
  std::vector<std::uint64_t> Revisions() const {
    const auto bytes_of = [this](const v1::Progress& progress) {
      return 4.0 / 3 * 4.0 * (status_.spec().dimension() + 1) *
             static_cast<double>(progress.simplices());
    };
    std::vector<std::uint64_t> revisions;
    double bytes = 0;
    std::uint64_t vertices = status_.progress().vertices();
    for (int i = status_.past_progress_size() - 1; i >= 0; --i) {
      const v1::PastProgress& past = status_.past_progress(i);
      if (past.progress().vertices() == vertices) continue;  // the same mesh as the next
      vertices = past.progress().vertices();
      bytes += bytes_of(past.progress());
      revisions.push_back(past.revision());
    }
    std::reverse(revisions.begin(), revisions.end());
    const double most = std::clamp(bytes_of(status_.progress()), kLeastBytes, kMostBytes);
    const auto step = static_cast<size_t>(1 + bytes / most);
    std::vector<std::uint64_t> some;
    for (size_t i = 0; i < revisions.size(); i += step) some.push_back(revisions[i]);
    return some;
  }

  const std::unique_ptr<v1::Stellate::Stub> stub_;
  const std::string mesh_;
  const RecordOptions& options_;
  v1::Mesh status_;
  std::string replies_;
  bool first_ = true;
};

}  // namespace

Expected<void> WriteRecording(const std::string& mesh, const std::string& path,
                              const RecordOptions& options) {
  if (auto ok = client::CheckWrite(path); !ok) return ok;
  const auto channel = client::Connect(options.connection);
  if (!channel) return tl::unexpected(channel.error());
  const Expected<std::string> recording = Recorder(*channel, mesh, options).Go();
  if (!recording) return tl::unexpected(recording.error());
  const Expected<std::string> page = PageWith(*recording);
  if (!page) return tl::unexpected(page.error());
  return client::WriteFile(path, *page);
}

}  // namespace stellate::view
