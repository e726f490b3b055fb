#include "server/convert/points.h"

#include <utility>

#include "core/base/message.h"
#include "server/convert/arrays.h"
#include "server/convert/spec.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;
using core::StatusCode;
using Eigen::Index;

Status Unfit(const char* field, std::string message) {
  return {StatusCode::kInvalidArgument, std::move(message), field};
}

Status CheckTimesAlone(const v1::MeshLimits& limits) {
  if (limits.max_vertices() == 0 && limits.max_rounds() == 0 && limits.max_batch_queries() == 0 &&
      limits.busy_seconds() == 0) {
    return Status::Ok();
  }
  return Unfit("limits",
               "limits of a reconstruction are worker_wait_seconds and answer_seconds alone: "
               "leave the others out");
}

Status ReadWeights(const v1::Reconstruction& spec, core::ReconstructionSpecification* out) {
  switch (spec.weights()) {
    case v1::WEIGHTING_UNSPECIFIED:
    case v1::WEIGHTING_AUTO:
      out->weights = core::Weighting::kAuto;
      return Status::Ok();
    case v1::WEIGHTING_ONLY:
      out->weights = core::Weighting::kOnly;
      return Status::Ok();
    default:
      return Unfit("weights",
                   Message("weights is ", static_cast<int>(spec.weights()),
                           ", which is no Weighting that this server knows: leave it out"));
  }
}

// The wire's rows are the columns of a matrix.
core::Expected<Eigen::MatrixXd> Rows(const v1::Array& array,
                                     std::initializer_list<std::uint64_t> shape, const char* name) {
  Status status = CheckArray(array, shape, name, StatusCode::kInvalidArgument);
  if (!status.ok()) return tl::unexpected(std::move(status));
  std::uint64_t size = 1;
  for (auto extent = shape.begin() + 1; extent != shape.end(); ++extent) size *= *extent;
  return MatrixFromProto(array, static_cast<Index>(size), static_cast<Index>(*shape.begin()));
}

}  // namespace

Allowed<MeshRequest> FromProto(const v1::Reconstruction& spec, const Config& config) {
  MeshRequest request;
  PointsRequest& points = request.points.emplace();
  points.points = spec.points();
  points.has_tangents = spec.tangents();
  if (spec.has_noise()) points.spec.noise = spec.noise();
  if (spec.has_declared_reach()) points.spec.reach = spec.declared_reach();
  if (spec.has_drop()) points.spec.drop = spec.drop();
  points.spec.closed = !spec.open();
  points.spec.steiner = spec.steiner();
  Refused refused = ReadWeights(spec, &points.spec);
  if (refused.ok()) refused = ReadCommon(spec, config, &request);
  if (!refused.ok()) return tl::unexpected(std::move(refused));
  points.spec.dimension = request.spec.dimension;
  points.spec.ambient_dimension = request.spec.ambient_dimension;
  refused = CheckTimesAlone(spec.limits());
  if (refused.ok()) refused = core::Validate(points.spec);
  if (!refused.ok()) return tl::unexpected(std::move(refused));
  if (spec.points() < static_cast<std::uint64_t>(points.spec.dimension) + 2) {
    return tl::unexpected(Refused(Unfit(
        "points", Message("points is ", spec.points(), " but a closed ", points.spec.dimension,
                          "-manifold needs ", points.spec.dimension + 2, " at least",
                          spec.points() < spec.ambient_dimension()
                              ? ": a row is a point; are rows and columns exchanged?"
                              : ""))));
  }
  return request;
}

void ToProto(const PointsRequest& points, v1::MeshSpec* spec) {
  v1::Reconstruction* const out = spec->mutable_reconstruction();
  out->set_dimension(static_cast<std::uint32_t>(points.spec.dimension));
  out->set_ambient_dimension(static_cast<std::uint32_t>(points.spec.ambient_dimension));
  out->set_points(points.points);
  out->set_tangents(points.has_tangents);
  if (points.spec.noise) out->set_noise(*points.spec.noise);
  if (points.spec.reach) out->set_declared_reach(*points.spec.reach);
  out->set_drop(points.spec.drop);
  out->set_open(!points.spec.closed);
  out->set_weights(points.spec.weights == core::Weighting::kOnly ? v1::WEIGHTING_ONLY
                                                                 : v1::WEIGHTING_AUTO);
  out->set_steiner(points.spec.steiner);
  out->set_label(spec->label());
  spec->set_dimension(out->dimension());
  spec->set_ambient_dimension(out->ambient_dimension());
  if (points.spec.reach) spec->set_declared_reach(*points.spec.reach);
  spec->mutable_limits()->set_max_vertices(points.points +
                                           core::MostAdded(points.spec, points.points));
}

core::Expected<PointsPart> FromProto(const v1::Points& points, const PointsRequest& request) {
  const auto d = static_cast<std::uint64_t>(request.spec.ambient_dimension);
  const auto k = static_cast<std::uint64_t>(request.spec.dimension);
  const v1::Array& array = points.points();
  // The number of rows is the client's choice; what it declares and does not send fails here.
  const std::uint64_t m = array.shape_size() > 0 ? array.shape(0) : 0;
  PointsPart part;
  part.first_row = points.first_row();
  auto rows = Rows(array, {m, d}, "points.points");
  if (!rows) return tl::unexpected(std::move(rows.error()));
  part.points = std::move(*rows);
  if (!request.has_tangents) {
    if (!points.has_tangents()) return part;
    return core::Refuse(StatusCode::kInvalidArgument,
                        "points.tangents came, but the specification did not announce them",
                        "points.tangents");
  }
  rows = Rows(points.tangents(), {m, d, k}, "points.tangents");
  if (!rows) return tl::unexpected(std::move(rows.error()));
  part.tangents = std::move(*rows);
  return part;
}

void ToProto(const core::ReconstructionCounts& counts, v1::ReconstructionReport* out) {
  for (int place = 0; place < core::kPlaces; ++place) {
    if (counts.places[place] == 0) continue;
    v1::ReconstructionReport::Count* const one = out->add_places();
    one->set_place(static_cast<v1::Place>(place));
    one->set_points(counts.places[place]);
    one->set_advice(core::PlaceAdvice(static_cast<core::Place>(place)));
  }
  out->set_spacing(counts.spacing);
  out->set_noise(counts.noise);
  out->set_noise_ratio(counts.noise_ratio);
  out->set_smoothed(counts.smoothed);
  out->set_doubtful(counts.doubtful);
  out->set_cavities(counts.cavities);
  out->set_tiles(counts.tiles);
  out->set_unfilled_vertices(counts.unfilled_vertices);
  for (const int k : {1, 2, 3, 4, 0}) out->add_looks(counts.looks[k]);
}

}  // namespace stellate::server
