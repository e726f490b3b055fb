#include "wire/convert.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstring>
#include <string>
#include <string_view>

#include "wire/status.h"

namespace stellate::client {
namespace {

static_assert(std::endian::native == std::endian::little, "arrays are copied as they are");

// The first extent, provided that the others and the data's size agree.
template <typename Message>
Expected<Eigen::Index> Rows(const Message& array, const std::vector<std::uint32_t>& shape,
                            size_t number_bytes) {
  if (array.shape_size() == 0 && array.data().empty()) return 0;
  bool fits = array.shape_size() == static_cast<int>(shape.size()) + 1;
  size_t row = number_bytes;
  for (size_t i = 0; fits && i < shape.size(); ++i) {
    fits = array.shape(static_cast<int>(i) + 1) == shape[i];
    row *= shape[i];
  }
  if (!fits || array.data().size() != row * array.shape(0)) {
    return tl::unexpected(BrokenProtocol("an array of the wrong shape"));
  }
  return static_cast<Eigen::Index>(array.shape(0));
}

}  // namespace

void ToArray(const Eigen::MatrixXd& columns, const std::vector<std::uint32_t>& shape,
             v1::Array* array) {
  array->add_shape(static_cast<std::uint32_t>(columns.cols()));
  for (const std::uint32_t extent : shape) array->add_shape(extent);
  array->set_data(columns.data(), static_cast<size_t>(columns.size()) * sizeof(double));
}

Expected<Eigen::MatrixXd> FromArray(const v1::Array& array,
                                    const std::vector<std::uint32_t>& shape) {
  const Expected<Eigen::Index> rows = Rows(array, shape, sizeof(double));
  if (!rows) return tl::unexpected(rows.error());
  Eigen::Index height = 1;
  for (const std::uint32_t extent : shape) height *= extent;
  Eigen::MatrixXd columns(height, *rows);
  if (!array.data().empty()) std::memcpy(columns.data(), array.data().data(), array.data().size());
  return columns;
}

Expected<void> AppendNumbers(const v1::Array& array, const std::vector<std::uint32_t>& shape,
                             std::vector<double>* numbers) {
  const Expected<Eigen::Index> rows = Rows(array, shape, sizeof(double));
  if (!rows) return tl::unexpected(rows.error());
  if (array.data().empty()) return {};
  const size_t old_size = numbers->size();
  numbers->resize(old_size + array.data().size() / sizeof(double));
  std::memcpy(numbers->data() + old_size, array.data().data(), array.data().size());
  return {};
}

Expected<Eigen::Index> CountRows(const v1::IndexArray& array, std::uint32_t width) {
  return Rows(array, {width}, sizeof(std::uint32_t));
}

namespace {

tl::unexpected<Error> Invalid(const std::string& why) {
  return Fail(ErrorCode::kRefused, why, "INVALID_ARGUMENT");
}

// Servers take so much; an oracle that is made of many others may say more.
constexpr size_t kMostAboutItself = 300;
// The server asks for larger dihedral angles, and tries more candidates, where the bound is above
// its default.
constexpr double kGoodSliverBound = 0.3;

std::string FirstCharacters(std::string_view utf8, size_t most) {
  size_t end = 0;
  for (; end < utf8.size(); ++end) {
    const bool begins = (static_cast<unsigned char>(utf8[end]) & 0xC0) != 0x80;
    if (begins && most-- == 0) break;
  }
  return std::string(utf8.substr(0, end));
}

// Servers take labels of so many walls, and say so of more.
constexpr int kMostWithLabels = 16;
constexpr std::uint8_t kHighestLabel = 127;

Expected<void> CheckLabels(const std::vector<std::uint8_t>& labels, int walls) {
  if (labels.empty()) return {};
  if (labels.size() != std::size_t{1} << std::min(walls, kMostWithLabels)) {
    return Invalid("there are " + std::to_string(labels.size()) + " labels, and " +
                   std::to_string(walls) + " walls have 2^" + std::to_string(walls) +
                   " vectors of signs: give one for each");
  }
  if (std::any_of(labels.begin(), labels.end(), [](std::uint8_t label) {
        return label > kHighestLabel && label != Oracle::kNoSuchSigns;
      })) {
    return Invalid("labels have to be numbers from 0, outside of M, to 127, or kNoSuchSigns");
  }
  return {};
}

Expected<void> CheckShape(const Oracle& oracle, const MeshOptions& options) {
  if (!options.good_shape) return {};
  if (oracle.dimension() != 3) {
    return Invalid("good_shape is for k = 3, and the manifold has k = " +
                   std::to_string(oracle.dimension()));
  }
  if (oracle.walls() > 0) {
    return Invalid("good_shape is for closed manifolds, and this one has a boundary");
  }
  if (options.sliver_bound) {
    return Invalid("good_shape says what sliver_bound is: give one of them");
  }
  return {};
}

}  // namespace

Expected<void> CheckServable(const Oracle& oracle, std::optional<std::uint32_t> max_chunk) {
  if (oracle.dimension() < 1) {
    return Invalid("dimension is " + std::to_string(oracle.dimension()) +
                   " but must be at least 1");
  }
  if (oracle.ambient_dimension() < 1) {
    return Invalid("ambient_dimension is " + std::to_string(oracle.ambient_dimension()) +
                   " but must be at least 2");
  }
  if (oracle.walls() < 0) {
    return Invalid("walls is " + std::to_string(oracle.walls()) + " but must be 0 or more");
  }
  if (oracle.walls() > 0 && !oracle.has_tangent_basis()) {
    return Invalid("the oracle has walls, and lacks tangent bases");
  }
  if (max_chunk == 0u) return Invalid("max_chunk is 0 but must be 1 or more");
  return CheckLabels(oracle.labels(), oracle.walls());
}

Expected<v1::MeshSpec> ToSpec(Oracle& oracle, const MeshOptions& options) {
  if (const auto ok = CheckServable(oracle, options.max_chunk); !ok) {
    return tl::unexpected(ok.error());
  }
  if (options.workers < 1 || options.workers > 1024) {
    return Invalid("workers is " + std::to_string(options.workers) + " but must be 1 to 1024");
  }
  if (const auto ok = CheckShape(oracle, options); !ok) return tl::unexpected(ok.error());
  const std::uint32_t d = static_cast<std::uint32_t>(oracle.ambient_dimension());
  v1::MeshSpec spec;
  spec.set_dimension(static_cast<std::uint32_t>(oracle.dimension()));
  spec.set_ambient_dimension(d);
  spec.set_epsilon(options.epsilon.length().value_or(0));  // kAuto is settled before
  spec.mutable_oracle()->set_intersect_flat(oracle.has_intersect_flat());
  spec.mutable_oracle()->set_tangent_basis(oracle.has_tangent_basis());
  spec.mutable_oracle()->set_local_size(oracle.has_local_size());
  spec.mutable_oracle()->set_conormals(oracle.walls() > 0);
  spec.mutable_oracle()->set_about(FirstCharacters(oracle.about(), kMostAboutItself));
  spec.set_walls(static_cast<std::uint32_t>(oracle.walls()));
  const std::vector<std::uint8_t> labels = oracle.labels();
  spec.set_labels(labels.data(), labels.size());
  for (const Walls& closure : oracle.closures()) {
    auto* const walls = spec.add_closures();
    for (const int wall : closure) walls->add_walls(static_cast<std::uint32_t>(wall));
  }
  const Eigen::VectorXd scale = oracle.coordinate_scale();
  spec.mutable_scale()->Add(scale.begin(), scale.end());
  for (std::string& name : oracle.region_names()) spec.add_region_names(std::move(name));
  if (const auto box = oracle.bounding_box()) {
    // Shape [d]: a corner is one point, not a list of them.
    for (const auto& [corner, array] :
         {std::pair(&box->lower, spec.mutable_bounding_box()->mutable_lower()),
          std::pair(&box->upper, spec.mutable_bounding_box()->mutable_upper())}) {
      array->add_shape(static_cast<std::uint32_t>(corner->size()));
      array->set_data(corner->data(), static_cast<size_t>(corner->size()) * sizeof(double));
    }
  }
  if (const Eigen::MatrixXd seeds = oracle.seeds(); seeds.cols() > 0) {
    ToArray(seeds, {static_cast<std::uint32_t>(seeds.rows())}, spec.mutable_seeds());
  }
  v1::Criteria& criteria = *spec.mutable_criteria();
  if (options.radius_edge_bound) criteria.set_radius_edge_bound(*options.radius_edge_bound);
  if (options.sliver_bound) criteria.set_sliver_bound(*options.sliver_bound);
  if (options.good_shape) criteria.set_sliver_bound(kGoodSliverBound);
  if (options.picking_radius) criteria.set_picking_radius(*options.picking_radius);
  if (options.small_sliver_radius) criteria.set_small_sliver_radius(*options.small_sliver_radius);
  if (options.candidates) criteria.set_candidates(*options.candidates);
  if (options.advance_step) criteria.set_advance_step(*options.advance_step);
  if (options.flat_alternations) criteria.set_flat_alternations(*options.flat_alternations);
  if (options.speculative) criteria.set_speculative(*options.speculative);
  if (options.size_rate) criteria.set_size_rate(*options.size_rate);
  if (options.max_deviation) criteria.set_max_deviation(*options.max_deviation);
  if (options.protection) criteria.set_protection(*options.protection);
  if (options.common_centre) criteria.set_common_centre(*options.common_centre);
  v1::MeshLimits& limits = *spec.mutable_limits();
  if (options.max_vertices) limits.set_max_vertices(*options.max_vertices);
  if (options.max_rounds) limits.set_max_rounds(*options.max_rounds);
  if (options.max_batch_queries) limits.set_max_batch_queries(*options.max_batch_queries);
  if (options.worker_wait) limits.set_worker_wait_seconds(options.worker_wait->count());
  if (options.answer_time) limits.set_answer_seconds(options.answer_time->count());
  if (options.busy_time) limits.set_busy_seconds(options.busy_time->count());
  if (options.box_seeds) spec.set_box_seeds(*options.box_seeds);
  if (options.components) spec.set_components(*options.components);
  if (options.thorough_audit.value_or(false)) spec.set_audit(v1::AUDIT_THOROUGH);
  if (options.reach) spec.set_declared_reach(*options.reach);
  if (options.cover_box) spec.set_cover_box(*options.cover_box);
  if (options.boundary_only) spec.set_boundary_only(*options.boundary_only);
  spec.set_random_seed(options.random_seed);
  spec.set_label(options.label);
  return spec;
}

Progress FromProto(const v1::Progress& m) {
  Progress p;
  p.phase = v1::Phase_IsValid(m.phase()) ? static_cast<Phase>(m.phase()) : Phase::kUnknown;
  p.round = m.round();
  p.queries = m.queries();
  p.vertices = m.vertices();
  p.simplices = m.simplices();
  p.unbounded_stars = m.unbounded_stars();
  p.bad_size = m.bad_size();
  p.bad_radius_edge = m.bad_radius_edge();
  p.bad_sliver = m.bad_sliver();
  p.bad_inconsistent = m.bad_inconsistent();
  p.bad_protection = m.bad_protection();
  p.fraction = m.fraction();
  p.elapsed_seconds = m.elapsed_seconds();
  p.remaining_seconds = m.remaining_seconds();
  return p;
}

namespace {

std::vector<std::uint32_t> Ids(const v1::IndexArray& array) {
  std::vector<std::uint32_t> ids(array.data().size() / sizeof(std::uint32_t));
  if (!ids.empty()) std::memcpy(ids.data(), array.data().data(), ids.size() * sizeof(ids[0]));
  return ids;
}

std::optional<std::uint32_t> LabelOf(bool there, std::uint32_t label) {
  return there ? std::optional(label) : std::nullopt;
}

ReconstructionReport FromProto(const v1::ReconstructionReport& m) {
  ReconstructionReport r;
  for (const v1::ReconstructionReport::Count& place : m.places()) {
    std::string name = v1::Place_Name(place.place());
    name = name.starts_with("PLACE_") ? name.substr(6) : "UNKNOWN";
    r.places.push_back({std::move(name), place.points(), place.advice()});
  }
  r.spacing = m.spacing();
  r.noise = m.noise();
  r.noise_ratio = m.noise_ratio();
  r.smoothed = m.smoothed();
  r.doubtful = m.doubtful();
  r.cavities = m.cavities();
  r.tiles = m.tiles();
  r.unfilled_vertices = m.unfilled_vertices();
  r.looks.assign(m.looks().begin(), m.looks().end());
  return r;
}

Violations FromProto(const v1::Violations& m) {
  Violations v{{}, Ids(m.links()), Ids(m.stars()), Ids(m.inconsistent()), Ids(m.fibres())};
  const std::vector<std::uint32_t> ids = Ids(m.faces());
  const std::size_t width = m.faces().shape_size() == 2 ? m.faces().shape(1) : 0;
  if (width == 0) return v;
  for (auto at = ids.begin(); ids.end() - at >= static_cast<std::ptrdiff_t>(width);) {
    const auto next = at + static_cast<std::ptrdiff_t>(width);
    v.faces.emplace_back(at, next);
    at = next;
  }
  return v;
}

Protection FromProto(const v1::Protection& m) {
  return {m.asked(),
          m.least(),
          m.percentile(),
          m.median(),
          m.least_ratio(),
          m.weak(),
          {m.worst().begin(), m.worst().end()},
          m.stability_radius(),
          m.thickness_bound(),
          m.is_delaunay()};
}

}  // namespace

Report ReportOf(const v1::Mesh& mesh) {
  const v1::Report& m = mesh.report();
  Report r;
  r.epsilon = mesh.spec().epsilon();
  r.termination = v1::Termination_IsValid(m.termination())
                      ? static_cast<Termination>(m.termination())
                      : Termination::kUnknown;
  r.failure_reason = m.failure().reason();
  r.failure_message = m.failure().message();
  r.elapsed_seconds = m.elapsed_seconds();
  r.text = m.text();
  if (m.has_finer()) r.finer = ChosenEpsilon{m.finer().epsilon(), m.finer().reason()};
  if (m.has_reconstruction()) r.reconstruction = FromProto(m.reconstruction());
  const v1::Counts& n = m.counts();
  r.counts = {n.vertices(),
              n.simplices(),
              n.rounds(),
              n.queries(),
              n.tangent_queries(),
              n.inserted_size(),
              n.inserted_radius_edge(),
              n.inserted_sliver(),
              n.inserted_inconsistent(),
              n.inserted_protection(),
              n.duplicates()};
  const v1::Certificate& c = m.certificate();
  Certificate& out = r.certificate;
  out.certified = c.certified();
  out.verdict = c.verdict();
  out.warnings.assign(c.warnings().begin(), c.warnings().end());
  out.closed = c.closed();
  out.bad_faces = c.bad_faces();
  out.links_are_spheres = c.links_are_spheres();
  out.links_decided_exactly = c.links_decided_exactly();
  out.bad_links = c.bad_links();
  out.inconsistent_simplices = c.inconsistent_simplices();
  out.unembedded_stars = c.unembedded_stars();
  out.fibre_failures = c.fibre_failures();
  out.fibre_samples = c.fibre_samples();
  out.max_circumradius = c.max_circumradius();
  out.max_radius_edge = c.max_radius_edge();
  out.min_fatness = c.min_fatness();
  out.min_angle_degrees = c.min_angle_degrees();
  out.max_tangent_angle_degrees = c.max_tangent_angle_degrees();
  out.max_barycentre_distance = c.max_barycentre_distance();
  out.estimated_reach = c.estimated_reach();
  out.epsilon_over_reach = c.epsilon_over_reach();
  out.components = c.components();
  out.euler_characteristic = c.euler_characteristic();
  out.orientable = c.orientable();
  out.betti.assign(c.betti().begin(), c.betti().end());
  out.level = v1::CertificateLevel_IsValid(c.level()) ? static_cast<CertificateLevel>(c.level())
                                                      : CertificateLevel::kUnknown;
  out.declared_reach = c.declared_reach();
  out.reach_refuted = c.reach_refuted();
  out.proved_distance = c.proved_distance();
  out.answers_checked = c.answers_checked();
  out.violations = FromProto(c.violations());
  out.boundary_simplices = c.boundary_simplices();
  out.boundary_components = c.boundary_components();
  out.boundary_euler_characteristic = c.boundary_euler_characteristic();
  for (const v1::FaceCertificate& face : c.faces())
    out.faces.push_back({{face.walls().begin(), face.walls().end()},
                         face.dimension(),
                         face.simplices(),
                         face.components(),
                         face.euler_characteristic(),
                         LabelOf(face.has_label_below(), face.label_below()),
                         LabelOf(face.has_label_above(), face.label_above()),
                         face.volume(),
                         {face.betti().begin(), face.betti().end()}});
  if (c.has_sharpest()) {
    const v1::WallAngle& s = c.sharpest();
    out.sharpest = WallAngle{
        {s.walls().begin(), s.walls().end()}, s.degrees(), {s.point().begin(), s.point().end()}};
  }
  for (const v1::RegionCertificate& region : c.regions())
    out.regions.push_back({region.label(),
                           region.simplices(),
                           region.components(),
                           region.euler_characteristic(),
                           region.volume(),
                           region.min_dihedral_degrees(),
                           {region.betti().begin(), region.betti().end()}});
  out.volume = c.volume();
  out.pinched_vertices = c.pinched_vertices();
  out.only_too_coarse = c.only_too_coarse();
  if (c.has_protection()) out.protection = FromProto(c.protection());
  return r;
}

MeshState FromProto(v1::MeshState state) {
  return v1::MeshState_IsValid(state) ? static_cast<MeshState>(state) : MeshState::kUnknown;
}

MeshStatus StatusOf(const v1::Mesh& m) {
  MeshStatus mesh;
  mesh.name = m.name();
  mesh.label = m.spec().label();
  mesh.owner = m.owner();
  mesh.state = FromProto(m.state());
  mesh.dimension = SimplexDimension(m.spec());
  mesh.ambient_dimension = static_cast<int>(m.spec().ambient_dimension());
  mesh.epsilon = m.spec().epsilon();
  mesh.progress = FromProto(m.progress());
  mesh.revision = m.revision();
  mesh.workers = m.workers();
  mesh.watchers = m.watchers();
  return mesh;
}

ServerHealth HealthOf(const v1::ServerInfo& info) {
  ServerHealth health;
  health.version = info.version();
  health.protocols.assign(info.protocols().begin(), info.protocols().end());
  health.max_dimension = info.max_dimension();
  health.max_ambient_dimension = info.max_ambient_dimension();
  health.max_meshes = info.max_meshes();
  health.max_vertices = info.max_vertices();
  health.max_rounds = info.max_rounds();
  health.max_message_bytes = info.max_message_bytes();
  health.owner_meshes = info.owner_meshes();
  health.max_memory_bytes = info.max_memory_bytes();
  health.owner_memory_bytes = info.owner_memory_bytes();
  health.max_workers = info.max_workers();
  health.max_watchers = info.max_watchers();
  health.check_share = info.check_share();
  return health;
}

}  // namespace stellate::client
