#include "stellate/reconstruct.h"

#include <google/protobuf/empty.pb.h>
#include <openssl/evp.h>

#include <Eigen/QR>
#include <algorithm>
#include <bit>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <utility>

#include "net/channel.h"
#include "net/reconnect.h"
#include "oracles/combined/units.h"
#include "run/host.h"
#include "stellate/download.h"
#include "stellate/v1/stellate.grpc.pb.h"
#include "wire/status.h"

namespace stellate {
namespace client {
namespace {

static_assert(std::endian::native == std::endian::little, "points are sent as they lie in memory");

constexpr Eigen::Index kPartBytes = Eigen::Index{1} << 20;
constexpr auto kFarewell = std::chrono::seconds(5);

std::string Sha256(const Eigen::MatrixXd& matrix) {
  std::string digest(EVP_MAX_MD_SIZE, '\0');
  unsigned size = 0;
  EVP_Digest(matrix.data(), static_cast<std::size_t>(matrix.size()) * sizeof(double),
             reinterpret_cast<unsigned char*>(digest.data()), &size, EVP_sha256(), nullptr);
  digest.resize(size);
  return digest;
}

v1::PointsChunk Named(const std::string& mesh) {
  v1::PointsChunk chunk;
  chunk.set_mesh(mesh);
  return chunk;
}

// A mesh of points, from its declaration to its last point. Deletes the mesh when it goes.
class Upload {
 public:
  Upload(const std::shared_ptr<grpc::Channel>& channel, const Eigen::MatrixXd& points,
         const Eigen::MatrixXd& tangents, const ReconstructOptions& options,
         std::function<bool()> hopeless)
      : stub_(v1::Stellate::NewStub(channel)),
        points_(points),
        tangents_(tangents),
        options_(options),
        attempts_({options.connection.reconnect, channel, std::move(hopeless),
                   options.connection.on_outage}) {}

  ~Upload() {
    if (name_.empty()) return;
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kFarewell);
    v1::DeleteMeshRequest request;
    request.set_name(name_);
    google::protobuf::Empty ignored;
    stub_->DeleteMesh(&context, request, &ignored);
  }

  // Returns the mesh's name, once the server has all points.
  Expected<std::string> Go() {
    const std::stop_callback cancel(options_.stop, [this] { attempts_.Stop(); });
    if (auto ok = Declare(); !ok) return tl::unexpected(ok.error());
    grpc::Status status;
    do {
      v1::ReconstructReply reply;
      status = Send({Named(name_)}, &reply);
      if (!status.ok()) continue;
      attempts_.Heard();
      status = SendRest(static_cast<Eigen::Index>(reply.rows()));
      if (status.ok()) return name_;
    } while (attempts_.Again(status));
    if (options_.stop.stop_requested()) {
      return Fail(ErrorCode::kStopped, "the reconstruction was cancelled");
    }
    return tl::unexpected(attempts_.Lost(status));
  }

 private:
  // Not tried again: a server that cannot be reached in the first place is an error immediately.
  Expected<void> Declare() {
    v1::PointsChunk chunk;
    v1::Reconstruction* const spec = chunk.mutable_spec();
    spec->set_dimension(static_cast<std::uint32_t>(std::max(options_.dimension, 0)));
    spec->set_ambient_dimension(static_cast<std::uint32_t>(points_.rows()));
    spec->set_points(static_cast<std::uint64_t>(points_.cols()));
    spec->set_tangents(tangents_.size() > 0);
    if (options_.noise) spec->set_noise(*options_.noise);
    if (options_.reach) spec->set_declared_reach(*options_.reach);
    spec->set_drop(options_.drop);
    spec->set_open(!options_.closed);
    if (options_.weights == Weighting::kOnly) spec->set_weights(v1::WEIGHTING_ONLY);
    spec->set_steiner(options_.steiner);
    spec->set_label(options_.label);
    v1::ReconstructReply reply;
    const grpc::Status status = Send({chunk}, &reply, kCallTime);
    if (!status.ok()) return tl::unexpected(FromStatus(status));
    name_ = reply.mesh().name();
    return {};
  }

  grpc::Status Send(const std::vector<v1::PointsChunk>& chunks, v1::ReconstructReply* reply,
                    std::chrono::milliseconds limit = {}) {
    grpc::ClientContext& context = attempts_.Attempt();
    if (limit.count() > 0) context.set_deadline(std::chrono::system_clock::now() + limit);
    const auto stream = stub_->Reconstruct(&context, reply);
    for (const v1::PointsChunk& chunk : chunks) {
      if (!stream->Write(chunk)) return stream->Finish();
    }
    stream->WritesDone();
    return stream->Finish();
  }

  // From a row on, and the end.
  grpc::Status SendRest(Eigen::Index first) {
    v1::ReconstructReply reply;
    const auto stream = stub_->Reconstruct(&attempts_.Attempt(), &reply);
    if (!stream->Write(Named(name_))) return stream->Finish();
    const Eigen::Index numbers = points_.rows() + tangents_.rows();
    const Eigen::Index rows = std::max<Eigen::Index>(
        kPartBytes / (numbers * static_cast<Eigen::Index>(sizeof(double))), 1);
    for (; first < points_.cols(); first += rows) {
      const Eigen::Index count = std::min(rows, points_.cols() - first);
      v1::PointsChunk chunk;
      chunk.mutable_points()->set_first_row(static_cast<std::uint64_t>(first));
      Fill(points_, first, count, {points_.rows()}, chunk.mutable_points()->mutable_points());
      if (tangents_.size() > 0) {
        Fill(tangents_, first, count, {points_.rows(), options_.dimension},
             chunk.mutable_points()->mutable_tangents());
      }
      if (!stream->Write(chunk)) return stream->Finish();
      Tell(first + count);
    }
    v1::PointsChunk end;
    end.mutable_end()->set_points_sha256(Sha256(points_));
    if (tangents_.size() > 0) end.mutable_end()->set_tangents_sha256(Sha256(tangents_));
    if (stream->Write(end)) stream->WritesDone();
    return stream->Finish();
  }

  static void Fill(const Eigen::MatrixXd& matrix, Eigen::Index first, Eigen::Index count,
                   std::initializer_list<Eigen::Index> shape, v1::Array* array) {
    array->add_shape(static_cast<std::uint32_t>(count));
    for (const Eigen::Index extent : shape) array->add_shape(static_cast<std::uint32_t>(extent));
    array->set_data(matrix.col(first).data(),
                    static_cast<std::size_t>(matrix.rows() * count) * sizeof(double));
  }

  void Tell(Eigen::Index rows) const {
    if (!options_.on_progress) return;
    Progress progress;
    progress.phase = Phase::kSeeding;
    progress.vertices = static_cast<std::uint64_t>(rows);
    options_.on_progress(progress);
  }

  const std::unique_ptr<v1::Stellate::Stub> stub_;
  const Eigen::MatrixXd& points_;
  const Eigen::MatrixXd& tangents_;
  const ReconstructOptions& options_;
  Reconnector attempts_;
  std::string name_;
};

Expected<void> Check(const Eigen::MatrixXd& points, const ReconstructOptions& options,
                     const Eigen::MatrixXd& tangents) {
  for (Eigen::Index row = 0; row < points.cols(); ++row) {
    if (points.col(row).allFinite()) continue;
    return Fail(ErrorCode::kRefused,
                "point " + std::to_string(row) + " has a coordinate that is not finite");
  }
  const bool fits = tangents.size() == 0 || (tangents.cols() == points.cols() &&
                                             tangents.rows() == points.rows() * options.dimension);
  if (!fits)
    return Fail(ErrorCode::kRefused, "tangents are not (d k) x n, as the points are d x n");
  return {};
}

// Axes of different units.
class Scale {
 public:
  // kRefused.
  static Expected<Scale> Of(const std::vector<double>& scale, Eigen::Index d) {
    const auto axes = static_cast<Eigen::Index>(scale.size());
    try {
      return Scale(oracles::UnitsOf(Eigen::Map<const Eigen::VectorXd>(scale.data(), axes), d));
    } catch (const std::invalid_argument& refusal) {
      return Fail(ErrorCode::kRefused, refusal.what());
    }
  }

  // kRefused for those that become infinite.
  Expected<Eigen::MatrixXd> Divided(const Eigen::MatrixXd& points) const {
    Eigen::MatrixXd divided = points.array().colwise() / units_.array();
    if (divided.allFinite()) return divided;
    return Fail(ErrorCode::kRefused, "points / scale are not finite");
  }

  // The tangent spaces there, by orthonormal vectors.
  Eigen::MatrixXd Tangents(const Eigen::MatrixXd& tangents, Eigen::Index k) const {
    using Basis = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const Eigen::Index d = units_.size();
    Eigen::MatrixXd scaled(tangents.rows(), tangents.cols());
    for (Eigen::Index j = 0; j < tangents.cols(); ++j) {
      const Eigen::Map<const Basis> own(tangents.col(j).data(), d, k);
      const Eigen::MatrixXd there = own.array().colwise() / units_.array();
      Eigen::Map<Basis>(scaled.col(j).data(), d, k) =
          there.householderQr().householderQ() * Eigen::MatrixXd::Identity(d, k);
    }
    return scaled;
  }

  // The mesh of points / scale as that of the points, to their last bit.
  Mesh Own(Mesh mesh, const Eigen::MatrixXd& points) const {
    mesh.points.array().colwise() *= units_.array();
    const Eigen::Index n = std::min(points.cols(), mesh.points.cols());
    mesh.points.leftCols(n) = points.leftCols(n);
    const std::string words = oracles::AboutUnits(units_);
    mesh.report.certificate.verdict += "; " + words;
    mesh.report.text += "        scale  " + words + "\n";
    return mesh;
  }

 private:
  explicit Scale(Eigen::VectorXd units) : units_(std::move(units)) {}

  Eigen::VectorXd units_;  // d
};

}  // namespace
}  // namespace client

Expected<Mesh> Reconstruct(const Eigen::MatrixXd& points, const ReconstructOptions& options,
                           const Eigen::MatrixXd& tangents) {
  if (auto ok = client::Check(points, options, tangents); !ok) return tl::unexpected(ok.error());
  if (!options.scale.empty()) {
    const auto scale = client::Scale::Of(options.scale, points.rows());
    if (!scale) return tl::unexpected(scale.error());
    const auto divided = scale->Divided(points);
    if (!divided) return tl::unexpected(divided.error());
    ReconstructOptions plain = options;
    plain.scale.clear();
    Expected<Mesh> mesh =
        Reconstruct(*divided, plain,
                    tangents.size() > 0 ? scale->Tangents(tangents, options.dimension) : tangents);
    if (mesh) return scale->Own(*std::move(mesh), points);
    return mesh;
  }
  const Expected<client::Host> host = client::Host::Find(options.connection);
  if (!host) return tl::unexpected(host.error());
  client::Upload upload(host->channel, points, tangents, options, host->IsHopeless());
  const Expected<std::string> name = upload.Go();
  if (!name) return tl::unexpected(name.error());
  DownloadOptions download;
  download.connection = host->connection;
  download.unfinished = Unfinished::kWait;
  download.on_progress = options.on_progress;
  download.stop = options.stop;
  return DownloadMesh(*name, download);
}

}  // namespace stellate
