// What is said of manifolds that are meshed too coarsely, and how soon.

#include <gtest/gtest.h>

#include <string>

#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::DrivenRun;
using testing::Make;
using testing::SpecificationFor;

struct CoarseCase {
  std::string manifold;
  double share;  // epsilon, of the reach
  bool tangents;
};

void PrintTo(const CoarseCase& c, std::ostream* out) {
  *out << c.manifold << " at " << c.share << (c.tangents ? "" : " without tangents");
}

class CoarseRuns : public ::testing::TestWithParam<CoarseCase> {};

// Runs that converge take some dozens of rounds; what ends otherwise does so after a few hundred,
// and its advice, an epsilon of 0.4 of the reach that it tells, is of use.
TEST_P(CoarseRuns, EndSoonWithAdviceThatIsOfUse) {
  const auto manifold = Make(GetParam().manifold);
  const double reach = *manifold->facts().reach;
  Specification spec = SpecificationFor(*manifold, GetParam().share * reach);
  spec.oracle.tangent_basis = GetParam().tangents;
  for (const std::uint64_t seed : {1u, 2u}) {
    spec.random_seed = seed;
    const DrivenRun run = Drive(spec, *manifold);
    const Report& report = run.report();
    EXPECT_LE(report.counts.rounds, 400u * static_cast<unsigned>(manifold->dimension()))
        << report.certificate.verdict;
    EXPECT_FALSE(report.certificate.certified && report.certificate.epsilon_over_reach > 1)
        << report.certificate.verdict;
    ASSERT_GT(report.certificate.estimated_reach, 0);
    EXPECT_GE(report.certificate.estimated_reach, 0.5 * reach);
    EXPECT_LE(report.certificate.estimated_reach, 2 * reach);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Catalogue, CoarseRuns,
    ::testing::Values(CoarseCase{"so3", 0.85, true}, CoarseCase{"so3", 0.85, false},
                      CoarseCase{"so3", 1.2, true}, CoarseCase{"flat-torus:3", 1.3, true},
                      CoarseCase{"torus:1:0.4", 1.5, false}, CoarseCase{"torus:1:0.4", 3, true}));

}  // namespace
}  // namespace stellate::core
