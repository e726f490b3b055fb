#include "core/complex/cavities.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "tests/core/support/in_process_run.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::AppendTo;
using testing::Drive;
using testing::DrivenRun;
using testing::FramedPoints;
using testing::Make;
using testing::SpecificationFor;
using testing::TorusGrid;

struct FilledCase {
  std::string manifold;
  double epsilon;
};

constexpr FillingRules RulesAt(double epsilon) { return {epsilon, 2.0, 0}; }

// How many of the simplices each facet is in.
template <int K>
std::map<std::array<std::uint32_t, K>, int> FacetsOf(const std::vector<std::uint32_t>& simplices) {
  std::map<std::array<std::uint32_t, K>, int> facets;
  for (std::size_t s = 0; s < simplices.size(); s += K + 1) {
    for (std::size_t left_out = 0; left_out <= K; ++left_out) {
      std::array<std::uint32_t, K> facet;
      for (std::size_t i = 0, at = 0; i <= K; ++i)
        if (i != left_out) facet[at++] = simplices[s + i];
      ++facets[facet];
    }
  }
  return facets;
}

// A well-spaced sample.
template <int K>
class Cavities {
 public:
  explicit Cavities(const FilledCase& c) : manifold_(Make(c.manifold)), epsilon_(c.epsilon) {
    Specification spec = SpecificationFor(*manifold_, c.epsilon);
    spec.criteria.centre_rule = CentreRule::kCommonCentre;
    const DrivenRun run = Drive(spec, *manifold_);
    sample_.d = manifold_->ambient_dimension();
    sample_.k = K;
    sample_.Append(run.mesher->Points(), run.mesher->Tangents());
  }

  FilledCavities Fill(CentreRule centre_rule) const {
    Stars<K> stars(sample_.d, epsilon_, {4 * epsilon_, centre_rule});
    AppendTo(&stars, sample_);
    stars.Commit();
    return FillCavities<K>(stars, RulesAt(epsilon_));
  }

 private:
  std::unique_ptr<Manifold> manifold_;
  double epsilon_;
  FramedPoints sample_;
};

// Cospherical as it is, all stars of a grid agree.
template <int K>
void ExpectNothingToFill(int n) {
  const FramedPoints sample = TorusGrid(K, n);
  const double epsilon = 1.1 * std::sqrt(K) * std::tan(std::numbers::pi / n);
  Stars<K> stars(sample.d, epsilon, {4 * epsilon, CentreRule::kCommonCentre});
  AppendTo(&stars, sample);
  stars.Commit();
  const FilledCavities filled = FillCavities<K>(stars, RulesAt(epsilon));
  EXPECT_EQ(filled.cavities, 0u);
  EXPECT_EQ(filled.inconsistent, 0u);
  EXPECT_EQ(filled.simplices, stars.Simplices());
}

TEST(CavitiesTest, AreNoneWhereStarsAgree) {
  ExpectNothingToFill<2>(24);
  ExpectNothingToFill<3>(10);
  ExpectNothingToFill<4>(6);
}

// Judged in flats, stars of the same sample disagree.
template <int K>
void ExpectClosedButForUnfilled(const FilledCase& c) {
  const FilledCavities filled = Cavities<K>(c).Fill(CentreRule::kTangentSpace);
  EXPECT_GT(filled.inconsistent, 0u);
  EXPECT_GT(filled.cavities, 0u);
  EXPECT_GT(filled.filled, 0u);
  EXPECT_GE(filled.filling, 2 * filled.filled);
  EXPECT_EQ(filled.unfilled.empty(), filled.filled == filled.cavities);
  for (const auto& [facet, count] : FacetsOf<K>(filled.simplices)) {
    const bool at_unfilled = std::all_of(facet.begin(), facet.end(), [&](std::uint32_t v) {
      return std::binary_search(filled.unfilled.begin(), filled.unfilled.end(), v);
    });
    EXPECT_LE(count, 2);
    EXPECT_TRUE(count == 2 || at_unfilled);
  }
}

TEST(CavitiesTest, AreClosedByTheirFilling) {
  ExpectClosedButForUnfilled<2>({"torus", 0.25});
  ExpectClosedButForUnfilled<3>({"flat-torus:3", 0.8});
}

}  // namespace
}  // namespace stellate::core
