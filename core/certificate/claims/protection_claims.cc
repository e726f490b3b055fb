#include "core/certificate/claims/protection_claims.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/base/message.h"
#include "core/certificate/measure/protection.h"
#include "core/geometry/reach.h"

namespace stellate::core {
namespace {

std::string Named(const Examination& x, const std::uint32_t* ids) {
  return Message("simplex ", NameSimplex(ids, x.mesh.k + 1), " near ", NamePoint(x.Vertex(ids[0])));
}

void WarnOfWeak(const ProtectionReport& report, Examination& x) {
  const double asked = x.spec.criteria.protection;
  x.findings.Warn(Message(
      "The protection of ", Brief(asked),
      " epsilon that was asked for was not reached: the least "
      "gap is ",
      Brief(report.least), " instead of ", Brief(report.asked), ", at ",
      Named(x, report.worst.data()), ", and ", report.weak, " of ",
      x.mesh.simplices->size() / (x.mesh.k + 1),
      " simplices have less than was asked. Points added there only made others weak. Ask for "
      "less (protection ",
      Brief(asked / 2),
      "), or take a smaller epsilon if it is above 0.3 of "
      "the reach."));
}

}  // namespace

void JudgeProtection(Examination& x) {
  if (!(x.facts.protection > 0) || !x.certificate.closed || !x.certificate.links_are_spheres ||
      x.certificate.unembedded_stars > 0)
    return;
  ProtectionFacts facts;
  facts.asked = x.facts.protection;
  facts.centre_rule = x.facts.centre_rule;
  const bool is_proved =
      x.findings.clean() && !x.findings.theorem().empty() && x.spec.oracle.tangent_basis;
  if (is_proved) {
    facts.reach = *x.spec.declared_reach;
    const double rho =
        std::min(x.shape.max_circumradius, JungRatio(x.mesh.k) * x.shape.max_diameter);
    facts.cover = rho + LargestDistance(rho, facts.reach);
  }
  const ProtectionFindings measured = MeasureProtection(x.mesh, facts);
  x.certificate.protection = measured.report;
  if (measured.report.weak > 0) WarnOfWeak(measured.report, x);
  if (!is_proved || measured.report.is_delaunay) return;
  const auto& [simplex, gap, needed] = *measured.worst;
  const std::string lacks = std::isfinite(needed) ? Message(" has a gap of ", Brief(gap),
                                                            " and would need ", Brief(needed))
                                                  : std::string(" is too large for that");
  x.findings.Warn(
      Message("Not shown to be the intrinsic Delaunay complex of its vertices: for the "
              "declared reach ",
              Brief(facts.reach), " ",
              Named(x, x.mesh.simplices->data() + std::size_t{simplex} * (x.mesh.k + 1)), lacks,
              ": take a smaller epsilon, or more protection."));
}

}  // namespace stellate::core
