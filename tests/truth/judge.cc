#include "tests/truth/judge.h"

#include <stdexcept>

#include "tests/support/homology.h"
#include "tests/support/run_mesher.h"
#include "tests/truth/knots.h"

namespace stellate::truth {
namespace {

// A runaway is as telling at this size as at any other. By k.
constexpr std::uint64_t kMostVertices[] = {0, 10'000, 12'000, 8'000};

bool IsRight(const Case& c, const testing::FinishedRun& run) {
  const auto corners = static_cast<std::size_t>(c.shape->k()) + 1;
  std::vector<testing::Facet> facets;
  for (std::size_t i = 0; i < run.simplices.size(); i += corners)
    facets.emplace_back(run.simplices.begin() + static_cast<std::ptrdiff_t>(i),
                        run.simplices.begin() + static_cast<std::ptrdiff_t>(i + corners));
  std::vector<int> betti = testing::BettiNumbers(facets, 2);
  betti.resize(corners, 0);
  if (betti != c.shape->Betti()) return false;
  const std::vector<Curve>* curves = c.shape->curves();
  if (!curves || c.shape->d() != 3) return true;
  std::vector<MatrixXd> truth;
  for (const Curve& curve : *curves) truth.push_back(curve.samples());
  return KnotTypeOf(Polygons(run.points, run.simplices)) == KnotTypeOf(truth);
}

// The reach of a shape with a hole is the hole's radius at most.
double ReachOf(const Case& c) { return c.hole > 0 ? c.hole : c.shape->Reach(); }

bool SawAll(const Case& c, bool thorough) {
  ShapeOracle oracle(c.shape, c.tangents, c.box, c.seeds);
  oracle.NoteComponents();
  core::Specification spec = SpecificationOf(c, oracle);
  spec.audit = thorough ? core::Audit::kThorough : core::Audit::kStandard;
  testing::RunMesher(oracle, spec, {.threads = 1});
  return static_cast<int>(oracle.components().size()) == c.shape->parts();
}

}  // namespace

core::Specification SpecificationOf(const Case& c, const ShapeOracle& oracle) {
  core::Specification spec = testing::SpecificationFor(oracle, c.epsilon);
  spec.limits.max_vertices = kMostVertices[c.shape->k()];
  return spec;
}

Run Judge(const Case& c, bool thorough, double declared) {
  Run result;
  ShapeOracle oracle(c.shape, c.tangents, c.box, c.seeds);
  core::Specification spec = SpecificationOf(c, oracle);
  spec.audit = thorough ? core::Audit::kThorough : core::Audit::kStandard;
  if (declared > 0 && ReachOf(c) > 0) spec.declared_reach = declared * ReachOf(c);
  try {
    const testing::FinishedRun run = testing::RunMesher(oracle, spec, {.threads = 1});
    const core::Certificate& certificate = run.report.certificate;
    result.told = certificate.verdict;
    result.counts = run.report.counts;
    result.estimated_reach = certificate.estimated_reach;
    result.proved = certificate.level == core::CertificateLevel::kProved;
    result.seconds = run.mesher_seconds;
    if (run.report.termination == core::Termination::kConverged) {
      result.outcome = Outcome::kRefused;
      if (certificate.certified) {
        const bool pretends = c.shape->Betti().empty();
        result.outcome = !pretends && IsRight(c, run) ? Outcome::kRight : Outcome::kFalse;
        if (result.outcome == Outcome::kFalse && !pretends && !SawAll(c, thorough))
          result.outcome = Outcome::kUnseen;
      }
    }
  } catch (const std::runtime_error& error) {
    result.told = error.what();
  }
  return result;
}

}  // namespace stellate::truth
