#include "stellate/report.h"

#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>
#include <utility>

#include "mesh/json.h"
#include "mesh/write_file.h"
#include "stellate/version.h"

namespace stellate {
namespace {

using client::JsonObject;

std::string CountsJson(const Counts& n) {
  JsonObject json;
  json.Add("vertices", n.vertices);
  json.Add("simplices", n.simplices);
  json.Add("rounds", n.rounds);
  json.Add("queries", n.queries);
  json.Add("tangent_queries", n.tangent_queries);
  json.Add("inserted_size", n.inserted_size);
  json.Add("inserted_radius_edge", n.inserted_radius_edge);
  json.Add("inserted_sliver", n.inserted_sliver);
  json.Add("inserted_inconsistent", n.inserted_inconsistent);
  json.Add("inserted_protection", n.inserted_protection);
  json.Add("duplicates", n.duplicates);
  return json.Take();
}

std::string IdsJson(const std::vector<std::uint32_t>& ids) {
  std::string text;
  for (const std::uint32_t id : ids) text += (text.empty() ? "" : ", ") + std::to_string(id);
  return "[" + text + "]";
}

std::string ViolationsJson(const Violations& v) {
  JsonObject json;
  std::string faces;
  for (const auto& ids : v.faces) faces += (faces.empty() ? "" : ", ") + IdsJson(ids);
  json.Raw("faces", "[" + faces + "]");
  json.Raw("links", IdsJson(v.links));
  json.Raw("stars", IdsJson(v.stars));
  json.Raw("inconsistent", IdsJson(v.inconsistent));
  json.Raw("fibres", IdsJson(v.fibres));
  return json.Take();
}

std::string NumbersJson(const std::vector<std::int64_t>& numbers) {
  std::string text;
  for (const std::int64_t number : numbers)
    text += (text.empty() ? "" : ", ") + std::to_string(number);
  return "[" + text + "]";
}

std::string LabelJson(const std::optional<std::uint32_t>& label) {
  return label ? std::to_string(*label) : "null";
}

std::string FacesJson(const std::vector<FaceCertificate>& faces) {
  std::string text;
  for (const FaceCertificate& face : faces) {
    JsonObject json;
    json.Raw("walls", IdsJson(face.walls));
    json.Raw("dimension", std::to_string(face.dimension));
    json.Add("simplices", face.simplices);
    json.Add("components", face.components);
    json.Raw("euler_characteristic", std::to_string(face.euler_characteristic));
    json.Raw("label_below", LabelJson(face.label_below));
    json.Raw("label_above", LabelJson(face.label_above));
    json.Add("volume", face.volume);
    json.Raw("betti", NumbersJson(face.betti));
    text += (text.empty() ? "" : ", ") + json.Take();
  }
  return "[" + text + "]";
}

std::string RegionsJson(const std::vector<RegionCertificate>& regions) {
  std::string text;
  for (const RegionCertificate& region : regions) {
    JsonObject json;
    json.Raw("label", std::to_string(region.label));
    json.Add("simplices", region.simplices);
    json.Add("components", region.components);
    json.Raw("euler_characteristic", std::to_string(region.euler_characteristic));
    json.Add("volume", region.volume);
    json.Add("min_dihedral_degrees", region.min_dihedral_degrees);
    json.Raw("betti", NumbersJson(region.betti));
    text += (text.empty() ? "" : ", ") + json.Take();
  }
  return "[" + text + "]";
}

std::string SharpestJson(const std::optional<WallAngle>& sharpest) {
  if (!sharpest) return "null";
  JsonObject json;
  json.Raw("walls", IdsJson(sharpest->walls));
  json.Add("degrees", sharpest->degrees);
  std::string point;
  for (const double x : sharpest->point)
    point += (point.empty() ? "" : ", ") + JsonObject::Number(x);
  json.Raw("point", "[" + point + "]");
  return json.Take();
}

std::string ProtectionJson(const std::optional<Protection>& p) {
  if (!p) return "null";
  JsonObject json;
  json.Add("asked", p->asked);
  json.Add("least", p->least);
  json.Add("percentile", p->percentile);
  json.Add("median", p->median);
  json.Add("least_ratio", p->least_ratio);
  json.Add("weak", p->weak);
  json.Raw("worst", IdsJson(p->worst));
  json.Add("stability_radius", p->stability_radius);
  json.Add("thickness_bound", p->thickness_bound);
  json.Add("is_delaunay", p->is_delaunay);
  return json.Take();
}

std::string CertificateJson(const Certificate& c) {
  JsonObject json;
  json.Add("certified", c.certified);
  json.Add("verdict", c.verdict);
  std::string warnings;
  for (const std::string& warning : c.warnings) {
    warnings += (warnings.empty() ? "" : ", ") + JsonObject::Quoted(warning);
  }
  json.Raw("warnings", "[" + warnings + "]");
  json.Add("closed", c.closed);
  json.Add("bad_faces", c.bad_faces);
  json.Add("links_are_spheres", c.links_are_spheres);
  json.Add("links_decided_exactly", c.links_decided_exactly);
  json.Add("bad_links", c.bad_links);
  json.Add("inconsistent_simplices", c.inconsistent_simplices);
  json.Add("unembedded_stars", c.unembedded_stars);
  json.Add("fibre_failures", c.fibre_failures);
  json.Add("fibre_samples", c.fibre_samples);
  json.Add("max_circumradius", c.max_circumradius);
  json.Add("max_radius_edge", c.max_radius_edge);
  json.Add("min_fatness", c.min_fatness);
  json.Add("min_angle_degrees", c.min_angle_degrees);
  json.Add("max_tangent_angle_degrees", c.max_tangent_angle_degrees);
  json.Add("max_barycentre_distance", c.max_barycentre_distance);
  json.Add("estimated_reach", c.estimated_reach);
  json.Add("epsilon_over_reach", c.epsilon_over_reach);
  json.Add("components", c.components);
  json.Raw("euler_characteristic", std::to_string(c.euler_characteristic));
  json.Add("orientable", c.orientable);
  json.Add("level", std::string(CertificateLevelName(c.level)));
  json.Add("declared_reach", c.declared_reach);
  json.Add("reach_refuted", c.reach_refuted);
  json.Add("proved_distance", c.proved_distance);
  json.Add("answers_checked", c.answers_checked);
  json.Raw("violations", ViolationsJson(c.violations));
  json.Add("boundary_simplices", c.boundary_simplices);
  json.Add("boundary_components", c.boundary_components);
  json.Raw("boundary_euler_characteristic", std::to_string(c.boundary_euler_characteristic));
  json.Raw("faces", FacesJson(c.faces));
  json.Raw("sharpest", SharpestJson(c.sharpest));
  json.Raw("regions", RegionsJson(c.regions));
  json.Add("pinched_vertices", c.pinched_vertices);
  json.Add("volume", c.volume);
  json.Add("only_too_coarse", c.only_too_coarse);
  json.Raw("protection", ProtectionJson(c.protection));
  json.Raw("betti", NumbersJson(c.betti));
  return json.Take();
}

std::string ReconstructionJson(const ReconstructionReport& r) {
  JsonObject places, advice, json;
  for (const ReconstructionReport::Place& place : r.places) {
    places.Add(place.name.c_str(), place.points);
    if (!place.advice.empty()) advice.Add(place.name.c_str(), place.advice);
  }
  json.Raw("places", places.Take());
  json.Raw("advice", advice.Take());
  json.Add("spacing", r.spacing);
  json.Add("noise", r.noise);
  json.Add("noise_ratio", r.noise_ratio);
  json.Add("smoothed", r.smoothed);
  json.Add("doubtful", r.doubtful);
  json.Add("cavities", r.cavities);
  json.Add("tiles", r.tiles);
  json.Add("unfilled_vertices", r.unfilled_vertices);
  std::string looks;
  for (const double share : r.looks) {
    looks += (looks.empty() ? "" : ", ") + JsonObject::Number(share);
  }
  json.Raw("looks", "[" + looks + "]");
  return json.Take();
}

}  // namespace

const char* TerminationName(Termination termination) {
  constexpr const char* kNames[] = {"UNKNOWN",   "CONVERGED",     "VERTEX_BUDGET", "ROUND_BUDGET",
                                    "CANCELLED", "ORACLE_FAILED", "NO_PROGRESS"};
  const size_t i = static_cast<size_t>(termination);
  return i < std::size(kNames) ? kNames[i] : kNames[0];
}

const char* CertificateLevelName(CertificateLevel level) {
  constexpr const char* kNames[] = {"UNKNOWN", "REFUSED", "SAMPLED", "PROVED", "DECIDED"};
  const size_t i = static_cast<size_t>(level);
  return i < std::size(kNames) ? kNames[i] : kNames[0];
}

const char* PhaseName(Phase phase) {
  constexpr const char* kNames[] = {"UNKNOWN", "SEEDING", "REFINING", "CERTIFYING", "DONE"};
  const size_t i = static_cast<size_t>(phase);
  return i < std::size(kNames) ? kNames[i] : kNames[0];
}

std::string ToJson(const Report& report) {
  JsonObject json;
  json.Add("termination", std::string(TerminationName(report.termination)));
  if (!report.failure_reason.empty() || !report.failure_message.empty()) {
    JsonObject failure;
    failure.Add("reason", report.failure_reason);
    failure.Add("message", report.failure_message);
    json.Raw("failure", failure.Take());
  }
  json.Add("epsilon",
           report.epsilon > 0 ? report.epsilon : std::numeric_limits<double>::quiet_NaN());
  json.Add("epsilon_reason", report.epsilon_reason);
  json.Raw("counts", CountsJson(report.counts));
  json.Raw("certificate", CertificateJson(report.certificate));
  if (report.reconstruction) {
    json.Raw("reconstruction", ReconstructionJson(*report.reconstruction));
  }
  json.Add("elapsed_seconds", report.elapsed_seconds);
  json.Add("version", std::string(STELLATE_VERSION));
  return json.Take();
}

Expected<void> SaveJson(const Report& report, const std::string& path) {
  return client::WriteFile(path, ToJson(report) + "\n");
}

}  // namespace stellate
