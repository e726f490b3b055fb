#include "server/convert/spec.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "core/base/message.h"
#include "core/reconstruction.h"
#include "server/convert/arrays.h"
#include "text/printable.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;
using core::StatusCode;
using Eigen::Index;

constexpr std::size_t kMaxLabelBytes = 128;
constexpr std::ptrdiff_t kMaxAboutCharacters = 300;

Status Invalid(const char* field, std::string message) {
  return {StatusCode::kInvalidArgument, std::move(message), field};
}
Refused TooLarge(const char* field, const char* setting, std::uint64_t value, std::string message) {
  return {{setting, Message(value), "mesh"}, std::move(message), field};
}

// Protobuf counts from 0 to 2^32 - 1; what an int cannot hold no rule would accept.
Status ToInt(std::uint32_t value, const char* field, int* out) {
  if (value > static_cast<std::uint32_t>(std::numeric_limits<int>::max())) {
    return {StatusCode::kLimitExceeded, Message(field, " is ", value, " but must be far smaller"),
            field};
  }
  *out = static_cast<int>(value);
  return Status::Ok();
}

template <typename Spec>
Refused ReadDimensions(const Spec& spec, const Config& config, core::Specification* out) {
  Status status = ToInt(spec.dimension(), "dimension", &out->dimension);
  if (!status.ok()) return status;
  // What no server of this build can do, core::Validate says.
  if (out->dimension > config.max_dimension && out->dimension <= core::LargestDimension()) {
    return TooLarge("dimension", "max-dimension", config.max_dimension,
                    Message("dimension (k) is ", out->dimension, " but this server allows ",
                            config.max_dimension, ": raise --max-dimension"));
  }
  if (spec.ambient_dimension() > static_cast<std::uint32_t>(config.max_ambient_dimension)) {
    return TooLarge("ambient_dimension", "max-ambient-dimension", config.max_ambient_dimension,
                    Message("ambient_dimension (d) is ", spec.ambient_dimension(),
                            " but this server allows ", config.max_ambient_dimension,
                            ": map the manifold into a space of lower dimension, or raise "
                            "--max-ambient-dimension"));
  }
  // Before the shapes of arrays are compared with it.
  if (spec.ambient_dimension() == 0) {
    return Invalid("ambient_dimension",
                   "ambient_dimension (d) is 0: set it to the number of coordinates of a point");
  }
  return ToInt(spec.ambient_dimension(), "ambient_dimension", &out->ambient_dimension);
}

Status ReadPlace(const v1::MeshSpec& spec, core::Specification* out) {
  const auto d = static_cast<std::uint64_t>(out->ambient_dimension);
  if (spec.has_bounding_box()) {
    core::BoundingBox box;
    for (const bool lower : {true, false}) {
      const v1::Array& array = lower ? spec.bounding_box().lower() : spec.bounding_box().upper();
      Status status = CheckArray(array, {d}, lower ? "bounding_box.lower" : "bounding_box.upper",
                                 StatusCode::kInvalidArgument);
      if (!status.ok()) return status;
      (lower ? box.lower : box.upper) = MatrixFromProto(array, static_cast<Index>(d), 1);
    }
    out->bounding_box = std::move(box);
  }
  if (spec.has_seeds() && !(spec.seeds().data().empty() && spec.seeds().shape_size() == 0)) {
    const v1::Array& seeds = spec.seeds();
    // The number of seeds is the client's choice; a declared one that is not there fails here.
    const std::uint64_t m = seeds.shape_size() > 0 ? seeds.shape(0) : 0;
    Status status = CheckArray(seeds, {m, d}, "seeds", StatusCode::kInvalidArgument);
    if (!status.ok()) return status;
    out->seeds = MatrixFromProto(seeds, static_cast<Index>(d), static_cast<Index>(m));
  }
  if (spec.has_declared_reach()) out->declared_reach = spec.declared_reach();
  out->cover_box = spec.cover_box();
  Status status = ToInt(spec.box_seeds(), "box_seeds", &out->box_seeds);
  if (!status.ok()) return status;
  return ToInt(spec.components(), "components", &out->components);
}

Status ReadAudit(const v1::MeshSpec& spec, core::Specification* out) {
  switch (spec.audit()) {
    case v1::AUDIT_UNSPECIFIED:
    case v1::AUDIT_STANDARD:
      out->audit = core::Audit::kStandard;
      return Status::Ok();
    case v1::AUDIT_THOROUGH:
      out->audit = core::Audit::kThorough;
      return Status::Ok();
    default:
      return Invalid("audit",
                     Message("audit is ", static_cast<int>(spec.audit()),
                             " but this server knows AUDIT_STANDARD and AUDIT_THOROUGH alone"));
  }
}

Status ReadCriteria(const v1::MeshSpec& spec, core::Specification* out) {
  const v1::Criteria& c = spec.criteria();
  core::Criteria& to = out->criteria;
  if (c.has_radius_edge_bound()) to.radius_edge_bound = c.radius_edge_bound();
  if (c.has_sliver_bound()) to.sliver_bound = c.sliver_bound();
  if (c.has_picking_radius()) to.picking_radius = c.picking_radius();
  if (c.has_small_sliver_radius()) to.small_sliver_radius = c.small_sliver_radius();
  if (c.has_advance_step()) {
    if (c.advance_step() < spec.epsilon()) {
      return Invalid(
          "criteria.advance_step",
          Message("criteria.advance_step is ", c.advance_step(), " but must be at least epsilon, ",
                  spec.epsilon(), ": leave it unset for 3 epsilon"));
    }
    to.advance_step = c.advance_step();
  }
  if (c.has_candidates()) {
    int candidates = 0;
    Status status = ToInt(c.candidates(), "criteria.candidates", &candidates);
    if (!status.ok()) return status;
    to.candidates = candidates;
  }
  to.speculative = c.speculative();
  if (c.has_size_rate()) to.size_rate = c.size_rate();
  if (c.has_max_deviation()) to.max_deviation = c.max_deviation();
  to.protection = c.protection();
  if (c.has_common_centre()) {
    to.centre_rule =
        c.common_centre() ? core::CentreRule::kCommonCentre : core::CentreRule::kTangentSpace;
  }
  if (!c.has_flat_alternations()) return Status::Ok();
  return ToInt(c.flat_alternations(), "criteria.flat_alternations", &to.flat_alternations);
}

Refused ReadSeconds(double value, double standard, double most, const char* field, double* out) {
  *out = value == 0 ? std::min(standard, most) : value;
  if (!(*out > 0)) {
    return Invalid(field, Message(field, " is ", value,
                                  " but must be a number of seconds above 0: leave it 0 for the "
                                  "server's default"));
  }
  if (*out > most) {
    return {{"max-wait", Message(most), "mesh"},
            Message(field, " is ", value, " but this server allows ", most,
                    ": ask for less, or raise --max-wait"),
            field};
  }
  return Status::Ok();
}

// `added`: vertices that may come besides.
Refused ReadVertices(std::uint64_t vertices, std::uint64_t added, const char* field,
                     const Config& config, core::Specification* out) {
  const auto d = std::max<std::uint64_t>(out->ambient_dimension, 1);
  const std::uint64_t room = std::max<std::uint64_t>(config.max_coordinates / d, 1);
  const std::uint64_t most = std::min(config.max_vertices, room);
  out->limits.max_vertices = vertices == 0 ? most : vertices;
  if (vertices <= most && added <= most - vertices) return Status::Ok();
  const bool room_binds = room < config.max_vertices;
  return TooLarge(field, room_binds ? "max-coordinates" : "max-vertices",
                  room_binds ? config.max_coordinates : config.max_vertices,
                  Message(field, " is ", vertices,
                          added > 0 ? Message(", and steiner may add ", added, " vertices,") : "",
                          " but this server allows ", most, " in ", d,
                          " dimensions: ask for fewer, or raise --max-vertices or "
                          "--max-coordinates"));
}

Refused ReadLimits(const v1::MeshSpec& spec, const Config& config, core::Specification* out) {
  const v1::MeshLimits& limits = spec.limits();
  core::Limits& to = out->limits;
  Refused refused = ReadVertices(limits.max_vertices(), 0, "limits.max_vertices", config, out);
  if (!refused.ok()) return refused;
  to.max_batch_queries = limits.max_batch_queries();
  to.max_rounds = limits.max_rounds() == 0 ? config.max_rounds : limits.max_rounds();
  if (to.max_rounds > config.max_rounds) {
    return TooLarge("limits.max_rounds", "max-rounds", config.max_rounds,
                    Message("limits.max_rounds is ", to.max_rounds, " but this server allows ",
                            config.max_rounds, ": ask for fewer, or raise --max-rounds"));
  }
  return Status::Ok();
}

Status CheckLabel(const std::string& label) {
  if (label.size() <= kMaxLabelBytes) return Status::Ok();
  return Invalid("label", Message("label has ", label.size(), " bytes but may have ",
                                  kMaxLabelBytes, ": shorten it"));
}

// What others are shown as the words of an oracle.
Status CheckAbout(const std::string& about) {
  if (about != text::Printable(about)) {
    return Invalid("oracle.about",
                   "oracle.about has control characters, line breaks or bytes that are no UTF-8: "
                   "leave them out, it is one sentence for people");
  }
  const auto characters = std::count_if(about.begin(), about.end(), [](unsigned char byte) {
    return (byte & 0xc0) != 0x80;  // all bytes of one but its first are 10xxxxxx
  });
  if (characters > kMaxAboutCharacters) {
    return Invalid("oracle.about",
                   Message("oracle.about has ", characters, " characters but may have ",
                           kMaxAboutCharacters, ": shorten it"));
  }
  return Status::Ok();
}

Clock::duration ToDuration(double seconds) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

Refused ReadTimeouts(const v1::MeshLimits& limits, const Config& config, OracleTimeouts* to) {
  const double most = MaxWaitSeconds(config);
  double worker_wait = 0, answer = 0, busy = 0;
  Refused refused = ReadSeconds(limits.worker_wait_seconds(), config.worker_wait_seconds, most,
                                "limits.worker_wait_seconds", &worker_wait);
  if (!refused.ok()) return refused;
  refused = ReadSeconds(limits.answer_seconds(), config.answer_seconds, most,
                        "limits.answer_seconds", &answer);
  if (!refused.ok()) return refused;
  refused =
      ReadSeconds(limits.busy_seconds(), config.busy_seconds, most, "limits.busy_seconds", &busy);
  if (!refused.ok()) return refused;
  if (limits.busy_seconds() == 0) busy = std::max(busy, answer);
  if (busy < answer) {
    return Invalid("limits.busy_seconds",
                   Message("limits.busy_seconds is ", busy, " but must be limits.answer_seconds (",
                           answer, ") or more: a worker may take that long without a word"));
  }
  // A wait shorter than the clock tells is not none.
  const auto wait = [](double seconds) {
    return std::max(ToDuration(seconds), Clock::duration(1));
  };
  *to = {wait(answer), wait(busy), wait(worker_wait)};
  return Status::Ok();
}

Refused ReadClosures(const v1::MeshSpec& spec, core::Specification* to) {
  for (const v1::Closure& closure : spec.closures()) {
    core::WallSet& walls = to->closures.emplace_back(0);
    for (const std::uint32_t wall : closure.walls()) {
      if (wall >= core::kMaxWalls)
        return Invalid("closures", Message("closures names wall ", wall, ", but there are ",
                                           spec.walls(), " walls"));
      walls |= core::SetOfWall(static_cast<int>(wall));
    }
  }
  return Status::Ok();
}

constexpr int kMaxRegions = 127;  // labels are bytes from 1 on

Refused ReadRegionNames(const v1::MeshSpec& spec, std::vector<std::string>* names) {
  if (spec.region_names_size() > kMaxRegions)
    return Invalid("region_names", Message("region_names has ", spec.region_names_size(),
                                           " names but may have ", kMaxRegions, ", one a label"));
  for (const std::string& name : spec.region_names()) {
    if (name.size() > kMaxLabelBytes)
      return Invalid("region_names",
                     Message("region_names[", names->size(), "] has ", name.size(),
                             " bytes but may have ", kMaxLabelBytes, ": shorten it"));
    if (name != text::Printable(name))
      return Invalid("region_names",
                     Message("region_names[", names->size(),
                             "] has control characters, line breaks or bytes that are no UTF-8: "
                             "leave them out, it is a name for people"));
    names->push_back(name);
  }
  return Status::Ok();
}

Refused ReadScale(const v1::MeshSpec& spec, Eigen::VectorXd* scale) {
  const int given = spec.scale_size();
  if (given != 0 && static_cast<std::uint32_t>(given) != spec.ambient_dimension())
    return Invalid("scale", Message("scale has ", given, " numbers but must have ",
                                    spec.ambient_dimension(), ", one for each axis, or none"));
  for (const double unit : spec.scale()) {
    if (!std::isfinite(unit) || !(unit > 0))
      return Invalid("scale", Message("scale has ", unit, " but its numbers must be above 0"));
  }
  *scale = Eigen::Map<const Eigen::VectorXd>(spec.scale().data(), given);
  return Status::Ok();
}

}  // namespace

Refused ReadCommon(const v1::Reconstruction& spec, const Config& config, MeshRequest* out) {
  out->label = spec.label();
  Refused refused = ReadDimensions(spec, config, &out->spec);
  core::ReconstructionSpecification adding;
  adding.steiner = spec.steiner();
  const std::uint64_t points = spec.points(), added = core::MostAdded(adding, points);
  if (refused.ok()) refused = ReadVertices(points, added, "points", config, &out->spec);
  if (refused.ok()) refused = ReadTimeouts(spec.limits(), config, &out->timeouts);
  if (refused.ok()) refused = CheckLabel(out->label);
  return refused;
}

Allowed<MeshRequest> ReadSpec(const v1::MeshSpec& spec, const Config& config) {
  MeshRequest request;
  request.spec.epsilon = spec.epsilon();
  request.spec.oracle.intersect_flat = spec.oracle().intersect_flat();
  request.spec.oracle.tangent_basis = spec.oracle().tangent_basis();
  request.spec.oracle.local_size = spec.oracle().local_size();
  request.spec.oracle.conormals = spec.oracle().conormals();
  request.spec.random_seed = spec.random_seed() == 0 ? 1 : spec.random_seed();
  request.label = spec.label();
  request.about = spec.oracle().about();
  Refused status = ToInt(spec.walls(), "walls", &request.spec.walls);
  request.spec.labels.assign(spec.labels().begin(), spec.labels().end());
  if (status.ok()) status = ReadClosures(spec, &request.spec);
  request.spec.boundary_only = spec.boundary_only();
  if (status.ok()) status = ReadDimensions(spec, config, &request.spec);
  if (status.ok()) status = ReadPlace(spec, &request.spec);
  if (status.ok()) status = ReadAudit(spec, &request.spec);
  if (status.ok()) status = ReadCriteria(spec, &request.spec);
  if (status.ok()) status = ReadLimits(spec, config, &request.spec);
  if (status.ok()) status = ReadTimeouts(spec.limits(), config, &request.timeouts);
  if (status.ok()) status = CheckLabel(request.label);
  if (status.ok() && spec.has_reconstruction()) {
    status = Invalid("reconstruction",
                     "reconstruction is set, but a mesh of points is made by the rpc Reconstruct");
  }
  if (status.ok()) status = CheckAbout(request.about);
  if (status.ok()) status = ReadRegionNames(spec, &request.region_names);
  if (status.ok()) status = ReadScale(spec, &request.scale);
  if (!status.ok()) return tl::unexpected(std::move(status));
  return request;
}

Allowed<MeshRequest> FromProto(const v1::MeshSpec& spec, const Config& config) {
  auto request = ReadSpec(spec, config);
  if (!request) return request;
  core::Status status = core::Validate(request->spec);
  if (!status.ok()) return tl::unexpected(Refused(std::move(status)));
  return request;
}

void ToProto(const core::Specification& spec, v1::MeshSpec* out) {
  out->Clear();
  out->set_dimension(spec.dimension);
  out->set_ambient_dimension(spec.ambient_dimension);
  out->set_epsilon(spec.epsilon);
  out->mutable_oracle()->set_intersect_flat(spec.oracle.intersect_flat);
  out->mutable_oracle()->set_tangent_basis(spec.oracle.tangent_basis);
  out->mutable_oracle()->set_local_size(spec.oracle.local_size);
  out->mutable_oracle()->set_conormals(spec.oracle.conormals);
  out->set_walls(static_cast<std::uint32_t>(spec.walls));
  out->set_labels(std::string(spec.labels.begin(), spec.labels.end()));
  for (const core::WallSet closure : spec.closures) {
    v1::Closure* const walls = out->add_closures();
    core::ForEachWall(closure,
                      [&](int wall) { walls->add_walls(static_cast<std::uint32_t>(wall)); });
  }
  out->set_boundary_only(spec.boundary_only);
  if (spec.bounding_box) {
    const auto d = static_cast<std::size_t>(spec.bounding_box->lower.size());
    v1::BoundingBox* const box = out->mutable_bounding_box();
    ToProto(spec.bounding_box->lower.data(), {d}, box->mutable_lower());
    ToProto(spec.bounding_box->upper.data(), {d}, box->mutable_upper());
  }
  v1::Criteria* const criteria = out->mutable_criteria();
  criteria->set_radius_edge_bound(spec.criteria.radius_edge_bound);
  if (spec.criteria.sliver_bound) criteria->set_sliver_bound(*spec.criteria.sliver_bound);
  criteria->set_picking_radius(spec.criteria.picking_radius);
  criteria->set_small_sliver_radius(spec.criteria.small_sliver_radius);
  if (spec.criteria.candidates) criteria->set_candidates(*spec.criteria.candidates);
  if (spec.criteria.advance_step) criteria->set_advance_step(*spec.criteria.advance_step);
  criteria->set_flat_alternations(spec.criteria.flat_alternations);
  criteria->set_speculative(spec.criteria.speculative);
  if (spec.criteria.size_rate) criteria->set_size_rate(*spec.criteria.size_rate);
  if (spec.criteria.max_deviation) criteria->set_max_deviation(*spec.criteria.max_deviation);
  if (spec.criteria.protection != 0) criteria->set_protection(spec.criteria.protection);
  if (spec.criteria.centre_rule) {
    criteria->set_common_centre(*spec.criteria.centre_rule == core::CentreRule::kCommonCentre);
  }
  out->mutable_limits()->set_max_vertices(spec.limits.max_vertices);
  out->mutable_limits()->set_max_rounds(spec.limits.max_rounds);
  out->mutable_limits()->set_max_batch_queries(spec.limits.max_batch_queries);
  out->set_random_seed(spec.random_seed);
  out->set_box_seeds(spec.box_seeds);
  out->set_components(static_cast<std::uint32_t>(spec.components));
  out->set_audit(spec.audit == core::Audit::kThorough ? v1::AUDIT_THOROUGH : v1::AUDIT_STANDARD);
  if (spec.declared_reach) out->set_declared_reach(*spec.declared_reach);
  out->set_cover_box(spec.cover_box);
}

}  // namespace stellate::server
