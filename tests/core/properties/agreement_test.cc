// That stars come to agree, and at what price: k = 3, where good points alone end it.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <ostream>

#include "tests/core/support/in_process_run.h"
#include "tests/core/support/trials.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::DrivenRun;
using testing::ForEachTrial;
using testing::Make;
using testing::SpecificationFor;

struct Coarse {
  const char* manifold;
  double reach;
  double share;  // epsilon in reaches
  double most;   // points from R4, as a share of all
};
void PrintTo(const Coarse& c, std::ostream* out) {
  *out << c.manifold << " at " << c.share << " reach";
}

class Agreement : public ::testing::TestWithParam<Coarse> {};

TEST_P(Agreement, TakesFewPointsWhateverTheSeed) {
  const auto manifold = Make(GetParam().manifold);
  ForEachTrial(3, [&](std::uint64_t seed) {
    Specification spec = SpecificationFor(*manifold, GetParam().share * GetParam().reach);
    spec.random_seed = seed;
    const DrivenRun run = Drive(spec, *manifold);
    const Report& report = run.report();
    EXPECT_TRUE(report.certificate.certified) << report.certificate.verdict;
    EXPECT_EQ(report.certificate.inconsistent_simplices, 0u);
    EXPECT_GE(report.certificate.min_fatness, std::pow(0.25, 3));
    const double vertices = static_cast<double>(report.counts.vertices);
    EXPECT_LE(static_cast<double>(report.counts.inserted_inconsistent), GetParam().most * vertices);
  });
}

const double kReachOfRotations = std::sqrt(2.0);

INSTANTIATE_TEST_SUITE_P(Tetrahedra, Agreement,
                         ::testing::Values(Coarse{"so3", kReachOfRotations, 0.4, 0.05},
                                           Coarse{"flat-torus:3", 1, 0.4, 0.05},
                                           Coarse{"so3", kReachOfRotations, 0.8, 0.4},
                                           Coarse{"flat-torus:3", 1, 0.8, 0.25}));

}  // namespace
}  // namespace stellate::core
