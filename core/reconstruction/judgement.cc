#include "core/reconstruction/judgement.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "core/base/interruption.h"
#include "core/base/message.h"
#include "core/base/name_point.h"
#include "core/certificate/claims/complex_claims.h"
#include "core/certificate/claims/declared_reach.h"
#include "core/certificate/claims/examination.h"
#include "core/certificate/point_of.h"

namespace stellate::core {
namespace {

// Rounding of coordinates, as a share of the largest.
constexpr double kCoordinateError = 1e-15;
// If fewer of the places look as many-dimensional as the caller says, the points are of another
// manifold; and if so many look otherwise, that is worth a warning.
constexpr double kMostlyRight = 0.5;
constexpr double kSomeOther = 0.1;

// Of EDGE, where a boundary is allowed already.
constexpr const char* kEdgeOfOpen =
    "the points end here, or have a hole, and do not show along which line: add points, or trim "
    "the mesh";

Specification SpecificationOf(const ReconstructionSpecification& spec, bool has_boundary) {
  Specification result;
  result.dimension = spec.dimension;
  result.ambient_dimension = spec.ambient_dimension;
  result.epsilon = kMaxLength;  // of no size
  result.walls = has_boundary ? 1 : 0;
  result.declared_reach = spec.reach;
  return result;
}

// "point 17, (0.5, 1, 0)", as it was given.
std::string NamePlace(const MeshView& mesh, const KnownOfPoints& known, std::uint32_t p) {
  const auto d = static_cast<Eigen::Index>(mesh.d);
  return Message("point ", p, ", ",
                 NamePoint(Eigen::Map<const Eigen::VectorXd>(known.given + p * mesh.d, d)));
}

// "at 12 of 1000 points (EDGE 10, NOISE 2), the first is point 17, (0.5, 1, 0): ..."
std::string DescribeCauses(const MeshView& mesh, const KnownOfPoints& known, bool closed) {
  std::uint64_t counts[kPlaces] = {};
  std::optional<std::uint32_t> first;
  for (std::uint32_t p = 0; p < known.causes.size(); ++p) {
    if (known.causes[p] == Place::kOk) continue;
    ++counts[static_cast<std::size_t>(known.causes[p])];
    if (!first) first = p;
  }
  std::string list;
  for (int place = 0; place < kPlaces; ++place)
    if (counts[place] > 0)
      list += Message(list.empty() ? "" : ", ", PlaceName(static_cast<Place>(place)), " ",
                      counts[place]);
  const Place cause = known.causes[*first];
  return Message("at ", known.against, " of ", mesh.vertices, " points (", list, "); the first is ",
                 NamePlace(mesh, known, *first), ": ", PlaceName(cause), ", ",
                 cause == Place::kEdge && !closed ? kEdgeOfOpen : PlaceAdvice(cause));
}

class Judge {
 public:
  Judge(const ReconstructionSpecification& spec, const MeshView& mesh, const KnownOfPoints& known,
        Report* report)
      : spec_(spec),
        mesh_(mesh),
        known_(known),
        counts_(*report->reconstruction),
        x_(SpecificationOf(spec, mesh.faces != nullptr), mesh, {.converged = true}),
        report_(*report) {}

  void Run() {
    const std::optional<StarGeometry> stars = JudgeComplex(x_);
    if (stars) {
      x_.certificate.estimated_reach = stars->reach;
      if (stars->reach > 0)
        x_.certificate.epsilon_over_reach = x_.certificate.max_circumradius / stars->reach;
      if (spec_.reach) JudgeReach();
    }
    Warn();
    Conclude();
    report_.certificate = std::move(x_.certificate);
  }

 private:
  void JudgeReach() {
    x_.certificate.declared_reach = *spec_.reach;
    if (known_.added > 0) {
      x_.findings.Warn(
          "Not proved for the declared reach: vertices were added, and the proof is about points "
          "that lie on the manifold.");
      return;
    }
    if (spec_.noise != 0.0) {
      x_.findings.Warn(
          "Not proved for the declared reach: the proof is about points that lie on the manifold; "
          "say so by noise = 0 if these do.");
      return;
    }
    const double sine = known_.tangent_error_length / *spec_.reach;
    DeclaredReach declared(mesh_, {*spec_.reach, std::asin(std::min(1.0, sine))},
                           known_.tangents_given);
    double largest = 0;
    for (std::uint32_t p = 0; p < mesh_.vertices; ++p)
      largest = std::max(largest, PointOf(mesh_, p).cwiseAbs().maxCoeff());
    const int k = mesh_.k;
    for (std::uint32_t s = 0; s < x_.list().size(); ++s) {
      CheckInterruption(s);
      const std::uint32_t* const ids = x_.list()[s];
      for (int i = 0; i <= k; ++i)
        for (int j = 0; j <= k; ++j)
          if (i != j) declared.TestEdge(ids[i], ids[j], kCoordinateError * largest);
    }
    if (x_.findings.clean()) declared.Prove(*x_.stars, x_.shape);
    declared.Conclude(false, x_.findings, x_.certificate);
  }

  void Warn() {
    const int k = spec_.dimension;
    if (known_.added > 0)
      x_.findings.Warn(Message(known_.added, known_.added == 1 ? " vertex is" : " vertices are",
                               " none of the points: added where stars disagreed, on the surface "
                               "fitted to the points, as the last of all."));
    if (known_.tangents_given) return;
    for (int other = 0; other <= 4; ++other) {
      if (other == k || counts_.looks[other] < kSomeOther) continue;
      x_.findings.Warn(Message("The points look ", other == 0 ? "more than 4" : Message(other),
                               "-dimensional at ", Brief(100 * counts_.looks[other]),
                               " % of the places, where the dimension was given as ", k, "."));
    }
    if (counts_.smoothed)
      x_.findings.Warn(
          "The points are noisy: the certificate is about the mesh at the smoothed positions. At "
          "the given ones its simplices may cross.");
  }

  bool LooksRight() const {
    return known_.tangents_given || counts_.looks[spec_.dimension] >= kMostlyRight;
  }

  // Noise, and points that are too few, look like more dimensions than there are.
  const char* OtherwiseCaused() const {
    const auto count = [&](Place place) { return counts_.places[static_cast<std::size_t>(place)]; };
    if (2 * (count(Place::kNoise) + count(Place::kSparse)) < known_.against) return "";
    return count(Place::kNoise) > count(Place::kSparse)
               ? "; or less noise, if it is noise that makes them look so"
               : "; or more points, if these are too few to show the dimension";
  }

  // If most places look of one other dimension, that is the cause of all else.
  std::string OtherDimension() const {
    if (LooksRight()) return "";
    for (int other = 0; other <= 4; ++other) {
      if (other == spec_.dimension || counts_.looks[other] < kMostlyRight) continue;
      return Message("they look ", other == 0 ? "more than 4" : Message(other), "-dimensional at ",
                     Brief(100 * counts_.looks[other]),
                     " % of the places. Give the dimension that they have; or, if coordinates are "
                     "in units of their own, scale them, so that a step counts alike in each",
                     OtherwiseCaused());
    }
    return "";
  }

  void Conclude() {
    Certificate& c = x_.certificate;
    c.warnings = x_.findings.warnings();
    const bool is_manifold = x_.findings.clean();
    const bool is_proved = is_manifold && !x_.findings.theorem().empty();
    const bool is_sampled =
        is_manifold && known_.against == 0 && LooksRight() && mesh_.faces == nullptr;
    c.certified = is_sampled || is_proved;
    c.level = is_proved     ? CertificateLevel::kProved
              : is_sampled  ? CertificateLevel::kSampled
              : is_manifold ? CertificateLevel::kDecided
                            : CertificateLevel::kRefused;
    c.verdict = Verdict();
  }

  std::string Causes() const {
    std::string causes = DescribeCauses(mesh_, known_, spec_.closed);
    if (spec_.weights != Weighting::kOnly || counts_.unfilled_vertices == 0) return causes;
    return Message(causes, ". No weights were found by which all stars agree, and at ",
                   counts_.unfilled_vertices,
                   " points they do not: thin the points to an even spacing, or let tilings fill "
                   "such places (weights = auto)");
  }

  // What is said of the dimension, if it looks wrong, and then of the places.
  std::string DimensionAndCauses() const {
    std::string all = OtherDimension();
    if (known_.against > 0)
      all += Message(all.empty() ? "" : ". As it is, ", "something is wrong ", Causes());
    return all;
  }

  // Why a manifold is not certified.
  std::string WhatIsMissing() const {
    if (!OtherDimension().empty()) return DimensionAndCauses();
    if (known_.against > 0) return Causes();
    if (!LooksRight())
      return Message("most places do not look ", spec_.dimension, "-dimensional, see the warnings");
    return "it has a boundary where they end, and points alone do not tell an end from a part that "
           "they are too few for";
  }

  std::string Verdict() const {
    const Certificate& c = x_.certificate;
    const std::string what = DescribeManifold(spec_.dimension, mesh_.faces != nullptr, c);
    const char* const unseen =
        " Parts of the manifold without points, and components of it, cannot be excluded.";
    switch (c.level) {
      case CertificateLevel::kProved:
        return Message("Proved: ", x_.findings.theorem(), ". It is ", what,
                       ". Assumed besides the reach: that the points lie on the manifold, and that "
                       "it has no boundary.",
                       unseen);
      case CertificateLevel::kSampled:
        return Message(
            "Certified: ", what,
            ". Decided on the whole mesh: it is closed, and each star embeds in the tangent space "
            "of its centre. The points agree: at each the noise is below half of the spacing, no "
            "other part of the manifold is as near as the neighbours, and tangent spaces turn by "
            "less than 60 degrees along each edge.",
            unseen);
      case CertificateLevel::kDecided:
        return Message("Not certified: the mesh is ", what,
                       ", but the points say too little of the manifold: ", WhatIsMissing(), ".");
      case CertificateLevel::kRefused:
        break;
    }
    const std::string causes = DimensionAndCauses();
    return Message("Not certified: ",
                   causes.empty() ? std::string()
                                  : Message("the points do not make a manifold of dimension ",
                                            spec_.dimension, ": ", causes, ". On the mesh: "),
                   x_.findings.Problems());
  }

  const ReconstructionSpecification& spec_;
  const MeshView& mesh_;
  const KnownOfPoints& known_;
  const ReconstructionCounts& counts_;
  Examination x_;
  Report& report_;
};

}  // namespace

void JudgeReconstruction(const ReconstructionSpecification& spec, const MeshView& mesh,
                         const KnownOfPoints& known, Report* report) {
  Judge(spec, mesh, known, report).Run();
}

}  // namespace stellate::core
