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

#include "core/complex/labels.h"
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

// T^3 in two labels: of a wall across the first circle, by a sample whose points near it lie on it.
class TwoLabels {
 public:
  static constexpr double kEpsilon = 0.8;

  TwoLabels() : stars_(6, kEpsilon, {4 * kEpsilon, CentreRule::kTangentSpace}, LabelTable({1, 2})) {
    const auto manifold = Make("flat-torus:3");
    Specification spec = SpecificationFor(*manifold, kEpsilon);
    spec.criteria.centre_rule = CentreRule::kCommonCentre;
    Eigen::MatrixXd points = Drive(spec, *manifold).mesher->Points();
    for (auto point : points.colwise())
      if (std::abs(point[0]) < 0.4 * kEpsilon) {
        point[1] = std::copysign(std::hypot(point[0], point[1]), point[1]);
        point[0] = 0;
      }
    FramedPoints sample;
    sample.d = 6;
    sample.k = 3;
    sample.Append(points, manifold->TangentBasis(points));
    for (std::uint32_t p = 0; p < sample.size(); ++p) {
      const double* const point = sample.Point(p);
      double outward[3] = {};
      for (int a = 0; a < 3; ++a)
        outward[a] = point[0] == 0 ? -sample.Tangent(p)[static_cast<std::ptrdiff_t>(a) * 6] : 0;
      stars_.Add(point, sample.Tangent(p), Stars<3>::kNone, point[0] == 0 ? 1 : 0, outward,
                 point[0] > 0 ? 1 : 0);
    }
    stars_.Commit();
  }

  const Stars<3>& stars() const { return stars_; }
  bool AreOnTheWall(const std::array<std::uint32_t, 3>& facet) const {
    return std::all_of(facet.begin(), facet.end(),
                       [&](std::uint32_t p) { return stars_.sample().walls(p) != 0; });
  }

 private:
  Stars<3> stars_;
};

TEST(CavitiesTest, OfARegionEndAtItsWalls) {
  const TwoLabels sample;
  const FilledCavities filled = FillCavities<3>(sample.stars(), RulesAt(1.5 * TwoLabels::kEpsilon));
  EXPECT_GT(filled.filled, 0u);
  EXPECT_GT(filled.filling, 0u);
  const std::vector<std::int8_t> labels = LabelsOf(sample.stars(), filled.simplices);
  std::vector<std::uint32_t> of_label[2];
  for (std::size_t s = 0; s < labels.size(); ++s) {
    const auto* const ids = filled.simplices.data() + 4 * s;
    of_label[labels[s] - 1].insert(of_label[labels[s] - 1].end(), ids, ids + 4);
    for (int i = 0; i < 4; ++i) {
      const double x = sample.stars().sample().Point(ids[i])[0];
      EXPECT_TRUE(labels[s] == 1 ? x <= 0 : x >= 0);
    }
  }
  int on_the_wall = 0;
  for (const auto& simplices : of_label) {
    for (const auto& [facet, count] : FacetsOf<3>(simplices)) {
      const bool at_unfilled = std::all_of(facet.begin(), facet.end(), [&](std::uint32_t v) {
        return std::binary_search(filled.unfilled.begin(), filled.unfilled.end(), v);
      });
      EXPECT_LE(count, 2);
      EXPECT_TRUE(count == 2 || at_unfilled || sample.AreOnTheWall(facet));
      on_the_wall += count == 1 && sample.AreOnTheWall(facet);
    }
  }
  EXPECT_GT(on_the_wall, 0);
}

TEST(CavitiesTest, AreClosedByTheirFilling) {
  ExpectClosedButForUnfilled<2>({"torus", 0.25});
  ExpectClosedButForUnfilled<3>({"flat-torus:3", 0.8});
}

}  // namespace
}  // namespace stellate::core
