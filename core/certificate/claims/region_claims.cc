#include "core/certificate/claims/region_claims.h"

#include <map>
#include <string>

#include "core/base/interruption.h"
#include "core/base/message.h"
#include "core/base/name_point.h"
#include "core/certificate/claims/closed_off.h"
#include "core/certificate/complex/betti.h"
#include "core/certificate/complex/links.h"
#include "core/certificate/measure/together.h"

namespace stellate::core {
namespace {

// Whether a point with these signs may be in a region, if the signs of some walls do not count.
bool MayBeIn(const LabelTable& table, int label, WallSet signs, WallSet unknown) {
  for (WallSet part = unknown;; part = (part - 1) & unknown) {
    if (table.Of((signs & ~unknown) | part) == label) return true;
    if (part == 0) return false;
  }
}

}  // namespace

void RegionClaims::Judge() {
  std::map<int, std::vector<std::uint32_t>> regions;
  const auto width = static_cast<std::size_t>(x_.mesh.k) + 1;
  for (std::uint32_t s = 0; s < x_.list().size(); ++s) {
    CheckInterruption(s);
    const std::uint32_t* ids = x_.list()[s];
    auto& region = regions[x_.mesh.labels[s]];
    region.insert(region.end(), ids, ids + width);
  }
  for (const auto& [label, simplices] : regions) JudgeRegion(label, simplices);
  x_.ReportPinched();
}

// In R^3 what is outside of a region tells its cavities (Alexander), where it does not touch
// itself.
std::vector<std::int64_t> RegionClaims::BettiNumbersOf(const RegionReport& report,
                                                       const std::vector<std::uint32_t>& simplices,
                                                       const ClosedOff& closed_off) const {
  const int k = x_.mesh.k;
  const auto components = static_cast<std::int64_t>(report.components);
  if (k < 3) return BettiNumbers(k, components, report.euler_characteristic, simplices);
  if (k > 3 || x_.mesh.d > 3 || !closed_off.copied.empty()) return {};
  const std::int64_t cavities =
      static_cast<std::int64_t>(ShapeOf(k - 1, closed_off.Boundary(k)).components) - components;
  return {components, components + cavities - report.euler_characteristic, cavities, 0};
}

void RegionClaims::JudgeRegion(int label, const std::vector<std::uint32_t>& simplices) {
  const int k = x_.mesh.k;
  const Adjacency region(SimplexList{k, static_cast<std::uint32_t>(x_.mesh.vertices), &simplices});
  const ClosedOff closed_off = CloseOff(x_.mesh, simplices, label, [&](const FaceMesh& face) {
    return (face.sides.first == label) != (face.sides.second == label);
  });
  x_.pinched.insert(closed_off.copied.begin(), closed_off.copied.end());
  const Adjacency closed(closed_off.list(k), closed_off.apex);
  const LinkReport links = CheckLinks(closed, closed_off.apex);
  RegionReport report;
  report.label = label;
  report.simplices = simplices.size() / (static_cast<std::size_t>(k) + 1);
  report.components = ComputeConnectivity(region).components;
  report.euler_characteristic = links.euler_characteristic + closed_off.EulerOfRest(k);
  const Together measured = MeasureTogether(x_.mesh, k, simplices);
  report.volume = measured.volume;
  report.min_dihedral_degrees = measured.min_dihedral_degrees;
  report.betti = BettiNumbersOf(report, simplices, closed_off);
  x_.certificate.regions.push_back(report);
  const std::string name = Message("the region of label ", label);
  if (closed.bad_facets() > 0)
    x_.findings.Refuse(
        Findings::kComplex,
        Message(name, " does not end where its faces are: ", closed.first_bad_facet(),
                ", where each must be in two, and ", closed_off.apex,
                " stands for what is beyond the region; faces like it: ", closed.bad_facets()));
  if (links.bad_links > 0)
    x_.findings.Refuse(Findings::kLinks, Message("in ", name, " ", links.first_bad_link,
                                                 "; vertices like it: ", links.bad_links));
  if (!closed_off.wrong_parts.empty())
    x_.findings.Refuse(Findings::kLinks, Message("in ", name, " ", closed_off.wrong_parts));
}

void RegionClaims::JudgeInside(const std::vector<std::uint32_t>& chosen, std::uint32_t each,
                               const AnswerBlock& answer) {
  if (answer.clearances.size() == 0) return;
  for (std::size_t n = 0; n < chosen.size(); ++n) {
    const std::uint32_t* ids = x_.list()[chosen[n]];
    // A simplex at a wall may lie beyond that, by as much as the wall bends.
    WallSet touched = 0;
    for (int i = 0; i <= x_.mesh.k; ++i) touched |= x_.mesh.WallsOf(ids[i]);
    const std::int8_t label = x_.mesh.labels[chosen[n]];
    for (std::size_t m = n * each; m < (n + 1) * each; ++m) {
      const auto j = static_cast<Eigen::Index>(m);
      if (!Found(answer, j)) continue;
      const WallSet signs = SignsOf(answer.clearances.col(j).data(), x_.spec.walls);
      if (MayBeIn(*x_.mesh.table, label, signs, touched)) continue;
      if (!x_.mesh.table->IsPossible(signs, touched)) {
        x_.findings.Refuse(
            Findings::kCoverage,
            Message("the labels say that no point has the signs of the walls that ",
                    NamePoint(answer.points.col(j)), " has, inside of simplex ",
                    NameSimplex(ids, x_.mesh.k + 1), ": correct the labels, or the walls"));
        continue;
      }
      x_.findings.Refuse(
          Findings::kCoverage,
          Message("simplex ", NameSimplex(ids, x_.mesh.k + 1), " has the label ", +label,
                  ", and at ", NamePoint(answer.points.col(j)), " in it the walls' signs say ",
                  x_.mesh.table->Of(signs),
                  ": a part of that region is missing that is smaller than epsilon; take epsilon "
                  "smaller, or give seeds there"));
    }
  }
}

}  // namespace stellate::core
