// The record of what a mesh came to.

#include <utility>

#include "server/records/journal_format.h"
#include "server/records/record_bytes.h"

namespace stellate::server {
namespace {

template <typename Archive, typename Value>
void LayOutProgress(Archive& archive, Value& progress) {
  archive.Number(progress.phase);
  archive.Number(progress.round);
  archive.Number(progress.queries);
  archive.Number(progress.vertices);
  archive.Number(progress.simplices);
  archive.Number(progress.unbounded_stars);
  archive.Number(progress.bad_size);
  archive.Number(progress.bad_radius_edge);
  archive.Number(progress.bad_sliver);
  archive.Number(progress.bad_inconsistent);
  archive.Number(progress.bad_protection);
  archive.Number(progress.fraction);
}

template <typename Archive, typename Value>
void LayOutReport(Archive& archive, Value& report) {
  archive.Number(report.termination);
  archive.Number(report.failure.code);
  archive.Bytes(report.failure.message);
  auto& counts = report.counts;
  archive.Number(counts.vertices);
  archive.Number(counts.simplices);
  archive.Number(counts.rounds);
  archive.Number(counts.queries);
  archive.Number(counts.tangent_queries);
  archive.Number(counts.inserted_size);
  archive.Number(counts.inserted_radius_edge);
  archive.Number(counts.inserted_sliver);
  archive.Number(counts.inserted_inconsistent);
  archive.Number(counts.inserted_protection);
  archive.Number(counts.duplicates);
  auto& certificate = report.certificate;
  archive.Number(certificate.certified);
  archive.Bytes(certificate.verdict);
  archive.Strings(certificate.warnings);
  archive.Number(certificate.closed);
  archive.Number(certificate.bad_faces);
  archive.Number(certificate.links_are_spheres);
  archive.Number(certificate.links_decided_exactly);
  archive.Number(certificate.bad_links);
  archive.Number(certificate.inconsistent_simplices);
  archive.Number(certificate.unembedded_stars);
  archive.Number(certificate.fibre_failures);
  archive.Number(certificate.fibre_samples);
  archive.Number(certificate.answers_checked);
  archive.Number(certificate.max_circumradius);
  archive.Number(certificate.max_radius_edge);
  archive.Number(certificate.min_fatness);
  archive.Number(certificate.min_angle_degrees);
  archive.Number(certificate.max_tangent_angle_degrees);
  archive.Number(certificate.max_barycentre_distance);
  archive.Number(certificate.estimated_reach);
  archive.Number(certificate.epsilon_over_reach);
  archive.Number(certificate.components);
  archive.Number(certificate.euler_characteristic);
  archive.Number(certificate.orientable);
  archive.Number(certificate.level);
  archive.Number(certificate.declared_reach);
  archive.Number(certificate.reach_refuted);
  archive.Number(certificate.proved_distance);
}

template <typename Archive, typename Value>
void LayOutBoundary(Archive& archive, Value& certificate) {
  archive.Number(certificate.boundary_simplices);
  archive.Number(certificate.boundary_components);
  archive.Number(certificate.boundary_euler_characteristic);
  std::size_t count = certificate.faces.size();
  archive.Number(count);
  if constexpr (!std::is_const_v<Value>) {
    // A forged number of them ends with the record.
    for (std::size_t i = 0; i < count && archive.good(); ++i) certificate.faces.emplace_back();
  }
  for (auto& face : certificate.faces) {
    archive.Number(face.walls);
    archive.Number(face.dimension);
    archive.Number(face.simplices);
    archive.Number(face.components);
    archive.Number(face.euler_characteristic);
    archive.Number(face.sides.first);
    archive.Number(face.sides.second);
    archive.Number(face.volume);
    archive.Ids(face.betti);
  }
  count = certificate.regions.size();
  archive.Number(count);
  if constexpr (!std::is_const_v<Value>) {
    for (std::size_t i = 0; i < count && archive.good(); ++i) certificate.regions.emplace_back();
  }
  for (auto& region : certificate.regions) {
    archive.Number(region.label);
    archive.Number(region.simplices);
    archive.Number(region.components);
    archive.Number(region.euler_characteristic);
    archive.Number(region.volume);
    archive.Number(region.min_dihedral_degrees);
    archive.Ids(region.betti);
  }
  archive.Number(certificate.pinched_vertices);
  archive.Number(certificate.volume);
}

template <typename Archive, typename Value>
void LayOutViolations(Archive& archive, Value& violations) {
  for (auto* ids : {&violations.faces, &violations.links, &violations.stars,
                    &violations.inconsistent, &violations.fibres}) {
    archive.Ids(*ids);
  }
}

void LayOutPast(RecordWriter& archive, const ProgressHistory& past) {
  archive.Number(past.all().size());
  for (const PastProgress& p : past.all()) {
    archive.Number(p.revision);
    LayOutProgress(archive, p.progress);
    archive.Number(p.elapsed_seconds);
  }
}

void LayOutPast(RecordReader& archive, ProgressHistory& past) {
  std::uint64_t count = 0;
  archive.Number(count);
  for (std::uint64_t i = 0; i < count && archive.good(); ++i) {
    PastProgress p;
    archive.Number(p.revision);
    LayOutProgress(archive, p.progress);
    archive.Number(p.elapsed_seconds);
    past.Add(p);
  }
}

template <typename Archive, typename Value>
void LayOutReconstruction(Archive& archive, Value& counts) {
  if (!archive.Has(counts.has_value())) return;
  if constexpr (!std::is_const_v<Value>) counts.emplace();
  for (auto& points : counts->places) archive.Number(points);
  archive.Number(counts->spacing);
  archive.Number(counts->noise);
  archive.Number(counts->noise_ratio);
  archive.Number(counts->smoothed);
  archive.Number(counts->doubtful);
  archive.Number(counts->cavities);
  archive.Number(counts->tiles);
  archive.Number(counts->unfilled_vertices);
  for (auto& share : counts->looks) archive.Number(share);
}

template <typename Archive, typename Value>
void LayOutProtection(Archive& archive, Value& protection) {
  if (!archive.Has(protection.has_value())) return;
  if constexpr (!std::is_const_v<Value>) protection.emplace();
  archive.Number(protection->asked);
  archive.Number(protection->least);
  archive.Number(protection->percentile);
  archive.Number(protection->median);
  archive.Number(protection->least_ratio);
  archive.Number(protection->weak);
  archive.Ids(protection->worst);
  archive.Number(protection->stability_radius);
  archive.Number(protection->thickness_bound);
  archive.Number(protection->is_delaunay);
}

// Where walls meet; without walls: they do not.
template <typename Archive, typename Value>
void LayOutSharpest(Archive& archive, Value& sharpest) {
  archive.Number(sharpest.walls);
  archive.Number(sharpest.degrees);
  archive.Numbers(sharpest.point);
}

}  // namespace

std::string EncodeResult(const SessionResult& result, std::uint64_t parts) {
  RecordWriter writer;
  LayOutProgress(writer, result.progress);
  LayOutReport(writer, result.report);
  writer.Number(result.revision);
  writer.Number(result.history_bytes);
  writer.Number(parts);
  LayOutBoundary(writer, result.report.certificate);
  LayOutViolations(writer, result.report.certificate.violations);
  LayOutPast(writer, result.past);
  const core::WallAngle sharpest = result.report.certificate.sharpest.value_or(core::WallAngle());
  LayOutSharpest(writer, sharpest);
  writer.Number(result.report.certificate.only_too_coarse);
  LayOutReconstruction(writer, result.report.reconstruction);
  LayOutProtection(writer, result.report.certificate.protection);
  writer.Ids(result.report.certificate.betti);
  return writer.Take();
}

std::optional<SessionResult> DecodeResult(std::string_view record, std::uint64_t* parts) {
  RecordReader reader(record);
  SessionResult result;
  LayOutProgress(reader, result.progress);
  LayOutReport(reader, result.report);
  reader.Number(result.revision);
  reader.Number(result.history_bytes);
  reader.Number(*parts);
  // Records of earlier servers end before the boundary, or after it, what is past or the angle.
  if (!reader.Complete()) LayOutBoundary(reader, result.report.certificate);
  if (!reader.Complete()) {
    LayOutViolations(reader, result.report.certificate.violations);
    LayOutPast(reader, result.past);
  }
  if (!reader.Complete()) {
    core::WallAngle sharpest;
    LayOutSharpest(reader, sharpest);
    if (sharpest.walls != 0) result.report.certificate.sharpest = std::move(sharpest);
  }
  if (!reader.Complete()) reader.Number(result.report.certificate.only_too_coarse);
  if (!reader.Complete()) LayOutReconstruction(reader, result.report.reconstruction);
  if (!reader.Complete()) LayOutProtection(reader, result.report.certificate.protection);
  if (!reader.Complete()) reader.Ids(result.report.certificate.betti);
  if (!reader.Complete()) return std::nullopt;
  return result;
}

}  // namespace stellate::server
