#include "core/certificate/findings.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <map>

#include "core/base/message.h"

namespace stellate::core {

std::string AboutInactiveWall(int walls, WallSet met) {
  for (int wall = 0; wall < walls; ++wall)
    if ((met & SetOfWall(wall)) == 0)
      return Message("; no point of wall ", wall,
                     " was found: does its function pass through zero with a slope?");
  return {};
}

std::string TooCoarse(double ratio, double reach, const std::string& where) {
  return Message(
      "the mesh size is ", Brief(ratio), " times the estimated reach ", Brief(reach),
      where.empty() ? "" : ", which was seen ", where,
      ": the manifold bends that sharply, or comes so near to itself, there; take epsilon "
      "at most ",
      Brief(kAdvised * reach));
}

void Findings::Refuse(Subject subject, std::string problem) {
  const auto place = std::lower_bound(problems_.begin(), problems_.end(), subject,
                                      [](const Problem& p, Subject s) { return p.subject < s; });
  if (place != problems_.end() && place->subject == subject) return;
  problems_.insert(place, {subject, std::move(problem)});
}

std::string Findings::Problems() const {
  if (clean()) return {};
  std::string text = Message(problems_.front().text, ".");
  if (problems_.size() > 1)
    text += Message(" Other checks failed too (", problems_.size() - 1,
                    "), next: ", problems_[1].text, ".");
  return text;
}

bool Findings::IsOnlyTooCoarse(double epsilon_over_reach) const {
  return problems_.size() == 1 && problems_.front().subject == kReach &&
         epsilon_over_reach <= kNearlyFine;
}

bool Findings::MayBeBoundary() const {
  return std::any_of(problems_.begin(), problems_.end(), [](const Problem& p) {
    switch (p.subject) {
      case kComplex:
      case kLinks:
      case kConsistency:
      case kStars:
      case kUndeclaredBoundary:
      case kBarycentres:
      case kCoverage:
      case kFibres:
        return true;
      case kSize:
      case kVertices:
      case kTangents:
      case kReach:
      case kComponents:
      case kDeviation:
      case kDeclaredReach:
      case kConvergence:
        return false;
    }
    return false;
  });
}

std::string Counted(std::uint64_t n, const char* what) {
  return Message(n, " ", what, n == 1 ? "" : "s");
}

// "6 pieces of walls, 12 edges and 8 corners"; `k`: of M. Certificate::faces has each of them.
std::string SumUpFaces(int k, const Certificate& certificate) {
  std::map<int, std::uint64_t, std::greater<>>
      pieces;  // by dimension; the same walls may meet twice
  for (const FaceReport& face : certificate.faces) pieces[face.dimension] += face.components;
  std::string text;
  for (auto it = pieces.begin(); it != pieces.end(); ++it) {
    const auto& [dimension, count] = *it;
    text += text.empty() ? "" : std::next(it) == pieces.end() ? " and " : ", ";
    text += dimension == k - 1
                ? k == 1 ? Counted(count, "end") : Counted(count, "piece") + " of walls"
            : dimension == 0 ? Counted(count, "corner")
            : dimension == 1 ? Counted(count, "edge")
                             : Message(Counted(count, "face"), " of dimension ", dimension);
  }
  return text;
}

// ", with a boundary of 2 components and Euler characteristic 0 (6 pieces of walls, ...)"
std::string DescribeBoundary(int k, const Certificate& certificate) {
  if (certificate.boundary_simplices == 0) return ", without boundary: no wall cuts it";
  return Message(", with a boundary of ", Counted(certificate.boundary_components, "component"),
                 " and Euler characteristic ", certificate.boundary_euler_characteristic, " (",
                 SumUpFaces(k, certificate), ")");
}

// ", in 2 regions (label 1: 1 component of Euler characteristic 2; ...)"; `where`: "in", or
// "around", if it is their surfaces.
std::string DescribeRegions(const Certificate& certificate, const char* where) {
  if (certificate.regions.empty()) return {};
  std::string regions;
  for (const RegionReport& region : certificate.regions)
    regions += Message(regions.empty() ? "" : "; ", "label ", region.label, ": ",
                       Counted(region.components, "component"), " of Euler characteristic ",
                       region.euler_characteristic);
  return Message(", ", where, " ", Counted(certificate.regions.size(), "region"), " (", regions,
                 ")");
}

// The verdict on a boundary without its inside.
std::string CertifiedBoundary(int k, const Certificate& certificate) {
  const bool has_regions = !certificate.regions.empty();
  return Message(
      "Certified: the boundary of ", has_regions ? "the regions" : "a domain", " of dimension ", k,
      ", without the inside: ", certificate.components,
      certificate.components == 1 ? " component" : " components", " of dimension ", k - 1,
      " and Euler characteristic ", certificate.euler_characteristic,
      DescribeRegions(certificate, "around"), ", of ", SumUpFaces(k, certificate),
      ". Decided on the whole mesh: ", has_regions ? "the surface of each region" : "it",
      " is closed, the links of its vertices are spheres, and neighbours agree about what is "
      "outside. Sampled: barycentres lie near their walls, and all of ",
      certificate.answers_checked,
      " points known of the walls lie on the mesh, which faces as the walls do there. Not looked "
      "at: what is inside, and whether parts of the boundary that are far apart along it meet in "
      "space. Pieces of walls that no question came near cannot be excluded.");
}

std::string DescribeManifold(int k, bool has_boundary, const Certificate& certificate) {
  const std::uint64_t components = certificate.components, pinched = certificate.pinched_vertices;
  const std::string except =
      pinched == 0 ? ""
                   : Message(", except at ", pinched, pinched == 1 ? " vertex" : " vertices",
                             " where it, or a region of it, touches itself,");
  return Message(has_boundary ? "a compact " : "a closed ",
                 certificate.orientable ? "orientable" : "non-orientable",
                 " manifold of dimension ", k, except, " with ", components,
                 components == 1 ? " component" : " components", " and Euler characteristic ",
                 certificate.euler_characteristic, DescribeRegions(certificate, "in"),
                 has_boundary ? DescribeBoundary(k, certificate) : "");
}

void Findings::Conclude(int k, const Specification& spec, Certificate& certificate) const {
  certificate.certified = clean();
  certificate.level = !clean()           ? CertificateLevel::kRefused
                      : theorem_.empty() ? CertificateLevel::kSampled
                                         : CertificateLevel::kProved;
  certificate.warnings = warnings_;
  if (!clean()) {
    certificate.verdict = Message("Not certified: ", Problems());
    certificate.only_too_coarse = IsOnlyTooCoarse(certificate.epsilon_over_reach);
    if (certificate.only_too_coarse)
      certificate.verdict +=
          " Nothing that was seen contradicts the mesh: it may be right, and is too coarse to "
          "certify.";
    if (spec.walls == 0 && MayBeBoundary()) certificate.verdict += Message(" ", kDeclareWalls, ".");
    return;
  }
  if (spec.boundary_only) {
    certificate.verdict = CertifiedBoundary(k, certificate);
    return;
  }
  const std::uint64_t components = certificate.components;
  const bool has_walls = spec.walls > 0;
  const std::string what = DescribeManifold(k, has_walls, certificate);
  const char* const unseen =
      "Components of the manifold that no seed or sampled point fell on cannot be excluded";
  const char* const declared = components == static_cast<std::uint64_t>(spec.components)
                                   ? ", but as many were declared."
                                   : ".";
  if (!theorem_.empty()) {
    certificate.verdict = Message("Proved: ", theorem_, ". It is ", what,
                                  ". Assumed besides the reach: that the oracle's answers are "
                                  "exact, and that the manifold has "
                                  "no boundary.");
    if (!covered_) certificate.verdict += Message(" ", unseen, declared);
    return;
  }
  certificate.verdict = Message(
      "Certified: ", what,
      has_walls
          ? ". Decided on the whole mesh: it ends at its faces and nowhere else, and each star "
            "embeds in the tangent cone of its centre. Sampled: "
          : ". Decided on the whole mesh: it is closed, and each star embeds in the tangent "
            "space of its centre. Sampled: ",
      certificate.fibre_samples, " normal flats meet the mesh once, ",
      spec.audit == Audit::kThorough ? "balls at every vertex and simplex"
                                     : "balls at some vertices",
      " show no reach below ", Brief(certificate.estimated_reach), ", and all of ",
      certificate.answers_checked,
      " answers that are no vertices lie on the mesh. Assumed: that the manifold has no ",
      has_walls ? "boundary but its walls, and no part, hole or void" : "boundary, and no part",
      " narrower than epsilon that no question came near. ", unseen, declared);
}

}  // namespace stellate::core
