#include "server/convert/mesh.h"

#include <algorithm>

#include "core/base/message.h"
#include "core/examiner.h"
#include "server/convert/arrays.h"
#include "server/convert/error_map.h"
#include "server/convert/points.h"
#include "server/convert/report_text.h"
#include "server/convert/scale.h"
#include "server/convert/spec.h"

namespace stellate::server {
namespace {

void SetTime(std::chrono::system_clock::time_point time, google::protobuf::Timestamp* out) {
  using std::chrono::duration_cast, std::chrono::nanoseconds, std::chrono::seconds;
  const auto since = time.time_since_epoch();
  const auto whole = duration_cast<seconds>(since);
  out->set_seconds(whole.count());
  out->set_nanos(static_cast<std::int32_t>(duration_cast<nanoseconds>(since - whole).count()));
}

void ToProto(const core::Counts& counts, v1::Counts* out) {
  out->set_vertices(counts.vertices);
  out->set_simplices(counts.simplices);
  out->set_rounds(counts.rounds);
  out->set_queries(counts.queries);
  out->set_tangent_queries(counts.tangent_queries);
  out->set_inserted_size(counts.inserted_size);
  out->set_inserted_radius_edge(counts.inserted_radius_edge);
  out->set_inserted_sliver(counts.inserted_sliver);
  out->set_inserted_inconsistent(counts.inserted_inconsistent);
  out->set_inserted_protection(counts.inserted_protection);
  out->set_duplicates(counts.duplicates);
}

v1::CertificateLevel ToProto(core::CertificateLevel level) {
  switch (level) {
    case core::CertificateLevel::kRefused:
      return v1::CERTIFICATE_LEVEL_REFUSED;
    case core::CertificateLevel::kDecided:
      return v1::CERTIFICATE_LEVEL_DECIDED;
    case core::CertificateLevel::kSampled:
      return v1::CERTIFICATE_LEVEL_SAMPLED;
    case core::CertificateLevel::kProved:
      return v1::CERTIFICATE_LEVEL_PROVED;
  }
  return v1::CERTIFICATE_LEVEL_UNSPECIFIED;
}

// Kinds without a fault are not set, nor is a whole without one.
void ToProto(const core::Violations& violations, int k, v1::Certificate* out) {
  if (!violations.faces.empty())
    server::ToProto(violations.faces, static_cast<std::size_t>(k),
                    out->mutable_violations()->mutable_faces());
  const auto vertices = [out](const std::vector<std::uint32_t>& ids, auto field) {
    if (ids.empty()) return;
    v1::IndexArray* const array = (out->mutable_violations()->*field)();
    array->add_shape(static_cast<std::uint32_t>(ids.size()));
    array->set_data(ids.data(), ids.size() * sizeof(ids[0]));
  };
  vertices(violations.links, &v1::Violations::mutable_links);
  vertices(violations.stars, &v1::Violations::mutable_stars);
  vertices(violations.inconsistent, &v1::Violations::mutable_inconsistent);
  vertices(violations.fibres, &v1::Violations::mutable_fibres);
}

void BoundaryToProto(const core::Certificate& c, v1::Certificate* out) {
  const auto add_walls = [](core::WallSet walls, auto* message) {
    core::ForEachWall(walls,
                      [&](int wall) { message->add_walls(static_cast<std::uint32_t>(wall)); });
  };
  out->set_boundary_simplices(c.boundary_simplices);
  out->set_boundary_components(c.boundary_components);
  out->set_boundary_euler_characteristic(c.boundary_euler_characteristic);
  for (const core::FaceReport& face : c.faces) {
    v1::FaceCertificate* const one = out->add_faces();
    add_walls(face.walls, one);
    one->set_dimension(static_cast<std::uint32_t>(face.dimension));
    one->set_simplices(face.simplices);
    one->set_components(face.components);
    one->set_euler_characteristic(face.euler_characteristic);
    one->set_volume(face.volume);
    one->mutable_betti()->Add(face.betti.begin(), face.betti.end());
    if (c.regions.empty() || core::CountWalls(face.walls) != 1) continue;
    one->set_label_below(static_cast<std::uint32_t>(face.sides.first));
    one->set_label_above(static_cast<std::uint32_t>(face.sides.second));
  }
  for (const core::RegionReport& region : c.regions) {
    v1::RegionCertificate* const one = out->add_regions();
    one->set_label(static_cast<std::uint32_t>(region.label));
    one->set_simplices(region.simplices);
    one->set_components(region.components);
    one->set_euler_characteristic(region.euler_characteristic);
    one->set_volume(region.volume);
    one->set_min_dihedral_degrees(region.min_dihedral_degrees);
    one->mutable_betti()->Add(region.betti.begin(), region.betti.end());
  }
  out->set_pinched_vertices(c.pinched_vertices);
  out->set_volume(c.volume);
  if (!c.sharpest) return;
  add_walls(c.sharpest->walls, out->mutable_sharpest());
  out->mutable_sharpest()->set_degrees(c.sharpest->degrees);
  out->mutable_sharpest()->mutable_point()->Add(c.sharpest->point.begin(), c.sharpest->point.end());
}

void ToProto(const core::ProtectionReport& p, v1::Protection* out) {
  out->set_asked(p.asked);
  out->set_least(p.least);
  out->set_percentile(p.percentile);
  out->set_median(p.median);
  out->set_least_ratio(p.least_ratio);
  out->set_weak(p.weak);
  out->mutable_worst()->Add(p.worst.begin(), p.worst.end());
  out->set_stability_radius(p.stability_radius);
  out->set_thickness_bound(p.thickness_bound);
  out->set_is_delaunay(p.is_delaunay);
}

void ToProto(const core::Certificate& c, int k, v1::Certificate* out) {
  out->set_certified(c.certified);
  out->set_verdict(c.verdict);
  for (const std::string& warning : c.warnings) out->add_warnings(warning);
  out->set_closed(c.closed);
  out->set_bad_faces(c.bad_faces);
  out->set_links_are_spheres(c.links_are_spheres);
  out->set_links_decided_exactly(c.links_decided_exactly);
  out->set_bad_links(c.bad_links);
  out->set_inconsistent_simplices(c.inconsistent_simplices);
  out->set_unembedded_stars(c.unembedded_stars);
  out->set_fibre_failures(c.fibre_failures);
  out->set_fibre_samples(c.fibre_samples);
  out->set_max_circumradius(c.max_circumradius);
  out->set_max_radius_edge(c.max_radius_edge);
  out->set_min_fatness(c.min_fatness);
  out->set_min_angle_degrees(c.min_angle_degrees);
  out->set_max_tangent_angle_degrees(c.max_tangent_angle_degrees);
  out->set_max_barycentre_distance(c.max_barycentre_distance);
  out->set_estimated_reach(c.estimated_reach);
  out->set_epsilon_over_reach(c.epsilon_over_reach);
  out->set_components(c.components);
  out->set_euler_characteristic(c.euler_characteristic);
  out->set_orientable(c.orientable);
  out->mutable_betti()->Add(c.betti.begin(), c.betti.end());
  out->set_level(ToProto(c.level));
  out->set_declared_reach(c.declared_reach);
  out->set_reach_refuted(c.reach_refuted);
  out->set_proved_distance(c.proved_distance);
  out->set_answers_checked(c.answers_checked);
  out->set_only_too_coarse(c.only_too_coarse);
  ToProto(c.violations, k, out);
  BoundaryToProto(c, out);
  if (c.protection) ToProto(*c.protection, out->mutable_protection());
}

}  // namespace

v1::MeshState ToProto(SessionState state) {
  switch (state) {
    case SessionState::kWaiting:
      return v1::MESH_STATE_WAITING;
    case SessionState::kRunning:
      return v1::MESH_STATE_RUNNING;
    case SessionState::kSucceeded:
      return v1::MESH_STATE_SUCCEEDED;
    case SessionState::kStopped:
      return v1::MESH_STATE_STOPPED;
    case SessionState::kCancelled:
      return v1::MESH_STATE_CANCELLED;
    case SessionState::kFailed:
      return v1::MESH_STATE_FAILED;
  }
  return v1::MESH_STATE_UNSPECIFIED;
}

v1::Phase ToProto(core::Phase phase) {
  switch (phase) {
    case core::Phase::kSeeding:
      return v1::PHASE_SEEDING;
    case core::Phase::kRefining:
      return v1::PHASE_REFINING;
    case core::Phase::kCertifying:
      return v1::PHASE_CERTIFYING;
    case core::Phase::kDone:
      return v1::PHASE_DONE;
  }
  return v1::PHASE_UNSPECIFIED;
}

v1::Termination ToProto(core::Termination termination) {
  switch (termination) {
    case core::Termination::kRunning:
      return v1::TERMINATION_UNSPECIFIED;
    case core::Termination::kConverged:
      return v1::TERMINATION_CONVERGED;
    case core::Termination::kVertexBudget:
      return v1::TERMINATION_VERTEX_BUDGET;
    case core::Termination::kRoundBudget:
      return v1::TERMINATION_ROUND_BUDGET;
    case core::Termination::kCancelled:
      return v1::TERMINATION_CANCELLED;
    case core::Termination::kOracleFailed:
      return v1::TERMINATION_ORACLE_FAILED;
    case core::Termination::kNoProgress:
      return v1::TERMINATION_NO_PROGRESS;
  }
  return v1::TERMINATION_UNSPECIFIED;
}

namespace {

void ToProto(const core::Progress& p, v1::Progress* out) {
  out->set_phase(server::ToProto(p.phase));
  out->set_round(p.round);
  out->set_queries(p.queries);
  out->set_vertices(p.vertices);
  out->set_simplices(p.simplices);
  out->set_unbounded_stars(p.unbounded_stars);
  out->set_bad_size(p.bad_size);
  out->set_bad_radius_edge(p.bad_radius_edge);
  out->set_bad_sliver(p.bad_sliver);
  out->set_bad_inconsistent(p.bad_inconsistent);
  out->set_bad_protection(p.bad_protection);
  out->set_fraction(p.fraction);
}

}  // namespace

void ToProto(const SessionView& view, v1::Progress* out) {
  ToProto(view.progress, out);
  out->set_elapsed_seconds(view.elapsed_seconds);
  out->set_remaining_seconds(view.remaining_seconds);
}

void ToProto(const core::Report& report, int k, v1::Report* out) {
  out->set_termination(ToProto(report.termination));
  ToProto(report.counts, out->mutable_counts());
  ToProto(report.certificate, k, out->mutable_certificate());
  if (report.reconstruction) {
    ToProto(*report.reconstruction, out->mutable_reconstruction());
  }
}

void ToProto(const std::vector<WorkerStats>& workers, v1::Mesh* out) {
  for (const WorkerStats& member : workers) {
    v1::WorkerStats* const worker = out->add_worker_stats();
    worker->set_number(member.id);
    worker->set_display_name(member.display_name);
    worker->set_queries(member.queries);
    worker->set_chunks(member.chunks);
    worker->set_fixed_seconds(member.fixed_seconds);
    worker->set_each_seconds(member.each_seconds);
    worker->set_newest_chunk(member.newest_chunk);
    worker->set_unanswered(member.unanswered);
    worker->set_lagging(member.lagging);
  }
}

void ToProto(const std::vector<PastProgress>& past, v1::Mesh* out) {
  for (const PastProgress& then : past) {
    v1::PastProgress* const row = out->add_past_progress();
    row->set_revision(then.revision);
    ToProto(then.progress, row->mutable_progress());
    row->mutable_progress()->set_elapsed_seconds(then.elapsed_seconds);
  }
}

void ToProto(const Session& session, v1::Mesh* out) {
  ToProto(session.request(), session.View(), out);
}

void ToProto(const MeshRequest& request, const SessionView& view, v1::Mesh* out) {
  out->set_name(request.name);
  if (!request.points) {
    ToProto(request.spec, out->mutable_spec());
    out->mutable_spec()->mutable_oracle()->set_about(request.about);
    out->mutable_spec()->mutable_region_names()->Add(request.region_names.begin(),
                                                     request.region_names.end());
    out->mutable_spec()->mutable_scale()->Add(request.scale.begin(), request.scale.end());
  }
  out->mutable_spec()->set_label(request.label);
  if (request.points) ToProto(*request.points, out->mutable_spec());
  v1::MeshLimits* const limits = out->mutable_spec()->mutable_limits();
  limits->set_worker_wait_seconds(
      std::chrono::duration<double>(request.timeouts.worker_wait).count());
  limits->set_answer_seconds(std::chrono::duration<double>(request.timeouts.answer_limit).count());
  limits->set_busy_seconds(std::chrono::duration<double>(request.timeouts.busy_limit).count());
  out->set_state(ToProto(view.state));
  SetTime(view.create_time, out->mutable_create_time());
  if (view.end_time) SetTime(*view.end_time, out->mutable_end_time());
  out->set_revision(view.revision);
  ToProto(view, out->mutable_progress());
  if (view.report) {
    v1::Report* const report = out->mutable_report();
    ToProto(*view.report, request.spec.simplex_dimension(), report);
    ToOwnCoordinates(request.scale, report->mutable_certificate());
    report->mutable_certificate()->set_verdict(VerdictOf(request, report->certificate().verdict()));
    report->set_elapsed_seconds(view.elapsed_seconds);
    if (const auto finer = core::ChooseFinerEpsilon(*view.report, request.spec.epsilon)) {
      report->mutable_finer()->set_epsilon(finer->epsilon);
      report->mutable_finer()->set_reason(finer->reason);
    }
    if (view.state == SessionState::kFailed) {
      report->set_termination(v1::TERMINATION_ORACLE_FAILED);
      report->mutable_failure()->set_reason(FailureReasonName(view.failure.reason));
      std::string message = view.failure.message;
      // An oracle's own words are its client's, who knows in which coordinates it spoke.
      if (view.failure.reason != FailureReason::kOracleFailed)
        message = InOwnCoordinates(request.scale, message);
      report->mutable_failure()->set_message(Cut(message, kMaxFailureBytes));
    }
    // Of a boundary alone it is measured what it encloses.
    report->set_text(ReportText(*report, request.spec.dimension, request.region_names));
  }
  out->set_workers(static_cast<std::uint32_t>(view.workers));
  out->set_watchers(static_cast<std::uint32_t>(view.watchers));
}

void ToProto(const DeltaPart& part, int k, int d, v1::DeltaChunk* out) {
  const auto row_size = static_cast<std::size_t>(k) + 1;
  const auto dimension = static_cast<std::size_t>(d);
  v1::MeshDelta* const delta = out->mutable_delta();
  delta->set_revision(part.revision);
  delta->set_first_vertex(part.first_vertex);
  ToProto(part.points.data(), {part.points.size() / dimension, dimension}, delta->mutable_points());
  ToProto(part.added, row_size, delta->mutable_added());
  ToProto(part.removed, row_size, delta->mutable_removed());
  delta->mutable_boundary_vertices()->Add(part.boundary.begin(), part.boundary.end());
  delta->mutable_boundary_walls()->Add(part.walls.begin(), part.walls.end());
  delta->mutable_added_labels()->assign(part.labels.begin(), part.labels.end());
  out->set_complete(part.complete);
}

void ToProto(const DeltaPart& part, int k, int d, v1::DownloadMeshResponse* out) {
  const auto dimension = static_cast<std::size_t>(d);
  out->set_revision(part.revision);
  out->set_first_vertex(part.first_vertex);
  ToProto(part.points.data(), {part.points.size() / dimension, dimension}, out->mutable_points());
  ToProto(part.added, static_cast<std::size_t>(k) + 1, out->mutable_cells());
  out->mutable_boundary_vertices()->Add(part.boundary.begin(), part.boundary.end());
  out->mutable_boundary_walls()->Add(part.walls.begin(), part.walls.end());
  if (part.orientation) {
    out->mutable_orientation()->set_orientable(part.orientation->orientable);
    out->mutable_orientation()->set_turned(part.orientation->turned.data(),
                                           part.orientation->turned.size());
  }
  out->mutable_cell_labels()->assign(part.labels.begin(), part.labels.end());
  if (!part.places.empty()) {
    out->mutable_places()->mutable_codes()->assign(part.places.begin(), part.places.end());
  }
  if (!part.smoothed.empty()) {
    ToProto(part.smoothed.data(), {part.smoothed.size() / dimension, dimension},
            out->mutable_places()->mutable_smoothed());
  }
  out->set_complete(part.complete);
}

std::size_t ToProto(const core::Orientation& orientation, std::size_t first_byte,
                    std::size_t max_bytes, v1::Orientation* out) {
  const std::size_t end = std::min(orientation.turned.size(), first_byte + max_bytes);
  out->set_orientable(orientation.orientable);
  out->set_first_simplex(8 * first_byte);
  out->set_turned(orientation.turned.data() + first_byte, end - first_byte);
  return end;
}

}  // namespace stellate::server
