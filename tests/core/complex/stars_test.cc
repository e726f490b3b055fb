#include "core/complex/stars.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <set>
#include <vector>

#include "core/complex/consistency.h"
#include "tests/core/support/cells.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::AppendTo;
using testing::AsSet;
using testing::Canonical;
using testing::CombinatoricsHold;
using testing::FramedPoints;
using testing::GivenHalfSpaces;
using testing::Make;
using testing::RandomSample;
using testing::StarOf;
using testing::TorusGrid;

constexpr double kEpsilon = 0.3;
constexpr double kInradius = 3;

template <int K>
std::unique_ptr<Stars<K>> NewStars(int d, CentreRule centre_rule) {
  return std::make_unique<Stars<K>>(d, kEpsilon, StarOptions{kInradius, centre_rule});
}

template <int K>
std::unique_ptr<Stars<K>> Build(const FramedPoints& sample,
                                CentreRule centre_rule = CentreRule::kTangentSpace) {
  auto stars = NewStars<K>(sample.d, centre_rule);
  AppendTo(stars.get(), sample);
  stars->Commit();
  return stars;
}

template <int K>
FramedPoints SampleOfDimension(int count, std::uint64_t seed) {
  const char* names[] = {"", "torus-knot:2:3", "torus:1:0.4", "so3", "sphere:4:6"};
  return RandomSample(*Make(names[K]), count, seed);
}

template <typename T>
class StarsTest : public ::testing::Test {};

// k, and where simplices are judged: what follows holds for both unless it says otherwise.
template <int K, CentreRule J>
struct Judged {
  static constexpr int kDimension = K;
  static constexpr CentreRule kCentreRule = J;
};
using Cases =
    ::testing::Types<Judged<1, CentreRule::kTangentSpace>, Judged<2, CentreRule::kTangentSpace>,
                     Judged<3, CentreRule::kTangentSpace>, Judged<4, CentreRule::kTangentSpace>,
                     Judged<2, CentreRule::kCommonCentre>, Judged<3, CentreRule::kCommonCentre>>;
TYPED_TEST_SUITE(StarsTest, Cases);

TYPED_TEST(StarsTest, ClipsEachCellByAllThatMatter) {
  constexpr int K = TypeParam::kDimension;
  if (TypeParam::kCentreRule != CentreRule::kTangentSpace)
    return SUCCEED();  // other cells are not polytopes
  const FramedPoints sample = SampleOfDimension<K>(K == 4 ? 120 : 250, 1);
  const auto stars = Build<K>(sample);
  ASSERT_EQ(stars->size(), sample.size());
  for (std::uint32_t p = 0; p < sample.size(); ++p) {
    // By the definition: cut by every other point, in the order of their ids.
    typename Stars<K>::Cell cell;
    GivenHalfSpaces<K> given(kInradius);
    cell.Reset(kInradius, given);
    for (std::uint32_t q = 0; q < sample.size(); ++q) {
      if (q == p) continue;
      double normal[K];
      const double distance2 = stars->sample().Project(p, sample.Point(q), normal);
      given.Clip(cell, q, normal, 0.5 * distance2);
    }
    const auto expected = Canonical(cell), got = Canonical(stars->cell(p));
    ASSERT_EQ(got.size(), expected.size()) << "star " << p;
    for (const auto& [ids, bits] : expected) {
      const auto at = got.find(ids);
      ASSERT_NE(at, got.end()) << "star " << p;
      for (std::size_t a = 0; a < K; ++a)
        EXPECT_NEAR(std::bit_cast<double>(at->second[a]), std::bit_cast<double>(bits[a]), 1e-6);
    }
    EXPECT_TRUE(CombinatoricsHold(stars->cell(p)));
  }
}

// Lemma 2.4.2 read backwards: the vertex, lifted into T_pM, is equidistant in R^d from the vertices
// of its simplex, and no sample point is nearer.
TYPED_TEST(StarsTest, HasCircumcentresOfEmptyBalls) {
  constexpr int K = TypeParam::kDimension;
  if (TypeParam::kCentreRule != CentreRule::kTangentSpace) return SUCCEED();
  const FramedPoints sample = SampleOfDimension<K>(K == 4 ? 120 : 250, 2);
  const auto stars = Build<K>(sample);
  std::vector<double> centre(static_cast<std::size_t>(sample.d));
  int simplices = 0;
  for (std::uint32_t p = 0; p < sample.size(); ++p) {
    const auto& cell = stars->cell(p);
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      stars->sample().Lift(p, cell.x(v), centre.data());
      const double norm2 = cell.norm2(v);
      const double tolerance = 1e-8 * (1 + norm2);
      for (std::uint32_t q = 0; q < sample.size(); ++q)
        EXPECT_GE(SquaredDistance(centre.data(), sample.Point(q), sample.d), norm2 - tolerance);
      typename Stars<K>::Simplex simplex;
      if (!stars->SimplexOf(p, stars->cell(p), v, &simplex)) continue;
      ++simplices;
      EXPECT_TRUE(std::is_sorted(simplex.begin(), simplex.end()));
      EXPECT_TRUE(std::binary_search(simplex.begin(), simplex.end(), p));
      for (const std::uint32_t q : simplex)
        EXPECT_NEAR(SquaredDistance(centre.data(), sample.Point(q), sample.d), norm2, tolerance);
    }
  }
  EXPECT_GT(simplices, 100);
}

TYPED_TEST(StarsTest, IsTheSameFromOneBatchOrManyOrOneByOne) {
  constexpr int K = TypeParam::kDimension;
  if (TypeParam::kCentreRule != CentreRule::kTangentSpace) return SUCCEED();
  const FramedPoints sample = SampleOfDimension<K>(K == 4 ? 100 : 300, 3);
  const auto at_once = Build<K>(sample);
  for (const std::uint32_t batch : {1u, 17u}) {
    auto stars = NewStars<K>(sample.d, CentreRule::kTangentSpace);
    for (std::uint32_t i = 0; i < sample.size(); ++i) {
      stars->Add(sample.Point(i), sample.Tangent(i));
      if (i % batch == batch - 1) stars->Commit();
    }
    stars->Commit();
    for (std::uint32_t p = 0; p < sample.size(); ++p)
      EXPECT_EQ(Canonical(stars->cell(p)), Canonical(at_once->cell(p))) << "star " << p;
    EXPECT_EQ(stars->Simplices(), at_once->Simplices());
  }
}

// A sample added in bulk has the stars that it has when it is appended, and takes further points.
TYPED_TEST(StarsTest, IsTheSameBuiltInBulkOrAppended) {
  constexpr int K = TypeParam::kDimension;
  if (TypeParam::kCentreRule != CentreRule::kTangentSpace) return SUCCEED();
  const FramedPoints sample = SampleOfDimension<K>(K == 4 ? 100 : 300, 5);
  const std::uint32_t sampled = sample.size() - 20;
  auto stars = NewStars<K>(sample.d, CentreRule::kTangentSpace);
  auto appended = NewStars<K>(sample.d, CentreRule::kTangentSpace);
  auto graded = NewStars<K>(sample.d, CentreRule::kTangentSpace);
  Random random(5, 0);
  for (std::uint32_t i = 0; i < sampled; ++i) {
    stars->AddInBulk(sample.Point(i), sample.Tangent(i));
    graded->AddInBulk(sample.Point(i), sample.Tangent(i), 0.3 * random.Uniform());
    appended->Add(sample.Point(i), sample.Tangent(i));
  }
  const auto change = stars->Commit();
  EXPECT_TRUE(change.stars.empty());
  EXPECT_TRUE(change.removed.empty());
  EXPECT_EQ(AsSet<K>(change.added), AsSet<K>(appended->Commit().added));
  EXPECT_EQ(change.added, graded->Commit().added);
  for (int last = 0; last < 2; ++last) {
    for (std::uint32_t p = 0; p < stars->size(); ++p)
      EXPECT_EQ(Canonical(stars->cell(p)), Canonical(appended->cell(p))) << "star " << p;
    EXPECT_EQ(stars->Simplices(), appended->Simplices());
    EXPECT_EQ(stars->simplex_count(), appended->simplex_count());
    for (std::uint32_t i = sampled; i < sample.size() && last == 0; ++i) {
      stars->Add(sample.Point(i), sample.Tangent(i));
      appended->Add(sample.Point(i), sample.Tangent(i));
    }
    EXPECT_EQ(stars->Commit().stars, appended->Commit().stars);
  }
}

TYPED_TEST(StarsTest, DoesNotDependOnTheNumberOfThreads) {
  constexpr int K = TypeParam::kDimension;
  const FramedPoints sample = SampleOfDimension<K>(K == 4 ? 100 : 400, 4);
  const auto build = [&](int threads) {
    auto stars = NewStars<K>(sample.d, TypeParam::kCentreRule);
    std::vector<std::vector<std::uint32_t>> changes;
    tbb::task_arena(threads).execute([&] {
      for (std::uint32_t i = 0; i < sample.size(); ++i) {
        stars->Add(sample.Point(i), sample.Tangent(i));
        if (i % 50 != 49) continue;
        auto change = stars->Commit();
        changes.insert(changes.end(), {change.stars, change.added, change.removed});
      }
    });
    return std::make_pair(std::move(stars), changes);
  };
  const auto [one, one_changes] = build(1);
  for (const int threads : {2, 4}) {
    const auto [many, many_changes] = build(threads);
    EXPECT_EQ(many_changes, one_changes);
    for (std::uint32_t p = 0; p < sample.size(); ++p)
      EXPECT_EQ(Canonical(many->cell(p)), Canonical(one->cell(p))) << "star " << p;
  }
}

TYPED_TEST(StarsTest, BuiltInBulkDoesNotDependOnTheNumberOfThreads) {
  constexpr int K = TypeParam::kDimension;
  const FramedPoints sample = SampleOfDimension<K>(K == 4 ? 100 : 400, 6);
  const auto build = [&](int threads) {
    auto stars = NewStars<K>(sample.d, TypeParam::kCentreRule);
    std::vector<std::uint32_t> added;
    tbb::task_arena(threads).execute([&] {
      for (std::uint32_t i = 0; i < sample.size(); ++i)
        stars->AddInBulk(sample.Point(i), sample.Tangent(i));
      added = stars->Commit().added;
    });
    return std::make_pair(std::move(stars), added);
  };
  const auto [one, one_added] = build(1);
  for (const int threads : {2, 4}) {
    const auto [many, many_added] = build(threads);
    EXPECT_EQ(many_added, one_added);
    for (std::uint32_t p = 0; p < sample.size(); ++p)
      EXPECT_EQ(Canonical(many->cell(p)), Canonical(one->cell(p))) << "star " << p;
  }
}

TYPED_TEST(StarsTest, TryPointShowsWhatCommitWouldDo) {
  constexpr int K = TypeParam::kDimension;
  const FramedPoints sample = SampleOfDimension<K>(K == 4 ? 100 : 200, 5);
  const FramedPoints more = SampleOfDimension<K>(K == 4 ? 10 : 40, 6);
  auto stars = Build<K>(sample, TypeParam::kCentreRule);
  typename Stars<K>::Tentative tentative;
  for (std::uint32_t i = 0; i < more.size(); ++i) {
    const std::uint32_t size = stars->size();
    const auto simplices = stars->Simplices();
    // With the star that it lies next to known, or not.
    std::pair<double, std::uint32_t> nearest;
    stars->sample().Nearest(more.Point(i), 1, &nearest);
    const std::uint32_t near = i % 2 == 0 ? nearest.second : Stars<K>::kNone;
    stars->TryPoint(more.Point(i), more.Tangent(i), near, &tentative);
    EXPECT_EQ(stars->size(), size);
    EXPECT_EQ(stars->Simplices(), simplices);

    ASSERT_EQ(stars->Add(more.Point(i), more.Tangent(i), near), size);
    const auto change = stars->Commit();
    ASSERT_EQ(tentative.own.size(), 1u);
    EXPECT_EQ(Canonical(stars->cell(size)), Canonical(tentative.own.front()));
    std::vector<std::uint32_t> cut;
    for (const auto& [p, sector, cell] : tentative.cut) {
      EXPECT_EQ(sector, 0);
      cut.push_back(p);
      EXPECT_EQ(Canonical(stars->cell(p)), Canonical(cell)) << "star " << p;
    }
    EXPECT_EQ(cut, change.stars);
  }
}

TYPED_TEST(StarsTest, ChangesAddUpToTheComplex) {
  constexpr int K = TypeParam::kDimension;
  const FramedPoints sample = SampleOfDimension<K>(K == 4 ? 100 : 300, 7);
  auto stars = NewStars<K>(sample.d, TypeParam::kCentreRule);
  std::set<typename Stars<K>::Simplex> replayed;
  for (std::uint32_t i = 0; i < sample.size(); ++i) {
    stars->Add(sample.Point(i), sample.Tangent(i));
    if (i % 13 != 12 && i + 1 != sample.size()) continue;
    std::vector<std::map<std::array<std::uint32_t, K>, std::array<std::uint64_t, K>>> before;
    const std::uint32_t old_size = i / 13 * 13;
    for (std::uint32_t p = 0; p < old_size; ++p) before.push_back(Canonical(stars->cell(p)));

    std::vector<std::uint32_t> around;
    const auto change = stars->Commit(&around);
    for (const auto& s : AsSet<K>(change.removed)) EXPECT_EQ(replayed.erase(s), 1u);
    for (const auto& s : AsSet<K>(change.added)) EXPECT_TRUE(replayed.insert(s).second);
    EXPECT_EQ(replayed, AsSet<K>(stars->Simplices()));
    EXPECT_EQ(stars->simplex_count(), replayed.size());

    std::vector<std::uint32_t> changed;
    for (std::uint32_t p = 0; p < old_size; ++p)
      if (Canonical(stars->cell(p)) != before[p]) changed.push_back(p);
    std::vector<std::uint32_t> told = change.stars;
    std::sort(told.begin(), told.end());
    EXPECT_EQ(told, changed);
    const std::set<std::uint32_t> listed(around.begin(), around.end());
    for (const std::uint32_t p : changed) {
      for (const auto& [ids, bits] : before[p])
        for (const std::uint32_t q : ids) EXPECT_TRUE(IsFake(q) || listed.contains(q));
      const auto& cell = stars->cell(p);
      for (std::size_t f = 0; f < cell.facet_count(); ++f)
        EXPECT_TRUE(IsFake(cell.id(f)) || listed.contains(cell.id(f)));
    }
  }
  EXPECT_TRUE(stars->Commit().stars.empty());  // nothing was appended
}

// Whatever waits for Commit is copied, too; and then both go on apart, with other points of the
// same ids.
TYPED_TEST(StarsTest, ACopyGoesOnFromTheSameState) {
  constexpr int K = TypeParam::kDimension;
  const FramedPoints sample = SampleOfDimension<K>(K == 4 ? 60 : 150, 13);
  const FramedPoints more = SampleOfDimension<K>(20, 14), other = SampleOfDimension<K>(20, 15);
  for (const bool in_bulk : {false, true}) {
    auto stars = NewStars<K>(sample.d, TypeParam::kCentreRule);
    for (std::uint32_t i = 0; i < sample.size(); ++i)
      in_bulk ? stars->AddInBulk(sample.Point(i), sample.Tangent(i), 0.3)
              : static_cast<void>(stars->Add(sample.Point(i), sample.Tangent(i)));
    Stars<K> copy = *stars, apart = *stars;
    EXPECT_EQ(copy.Commit().added, stars->Commit().added);
    apart.Commit();
    AppendTo(&apart, other);
    apart.Commit();
    AppendTo(stars.get(), more);
    AppendTo(&copy, more);
    EXPECT_EQ(copy.Commit().added, stars->Commit().added);
    ASSERT_EQ(copy.size(), sample.size() + more.size());
    for (std::uint32_t p = 0; p < copy.size(); ++p)
      EXPECT_EQ(Canonical(copy.cell(p)), Canonical(stars->cell(p))) << "star " << p;
    EXPECT_EQ(copy.Simplices(), stars->Simplices());
    EXPECT_NE(apart.Simplices(), stars->Simplices());
  }
}

TYPED_TEST(StarsTest, SimplicesAreThoseOfTheirLowestVertexInOrder) {
  constexpr int K = TypeParam::kDimension;
  const auto stars = Build<K>(SampleOfDimension<K>(100, 8), TypeParam::kCentreRule);
  std::vector<std::uint32_t> expected;
  for (std::uint32_t p = 0; p < stars->size(); ++p)
    for (const auto& s : StarOf(*stars, p))
      if (s[0] == p) expected.insert(expected.end(), s.begin(), s.end());
  EXPECT_EQ(stars->Simplices(), expected);
}

TYPED_TEST(StarsTest, FindsPointsWithinARadiusAlsoBeforeCommit) {
  constexpr int K = TypeParam::kDimension;
  const FramedPoints sample = SampleOfDimension<K>(60, 9);
  const FramedPoints probes = SampleOfDimension<K>(60, 10);
  auto stars = NewStars<K>(sample.d, TypeParam::kCentreRule);
  for (std::uint32_t i = 0; i < sample.size(); ++i) {
    stars->Add(sample.Point(i), sample.Tangent(i));
    if (i == 30) stars->Commit();
    const double radius = 0.05 * (1 + i % 10);
    bool any = false;
    for (std::uint32_t j = 0; j <= i; ++j)
      any = any || Distance(probes.Point(i), sample.Point(j), sample.d) <= radius;
    EXPECT_EQ(stars->sample().AnyWithin(probes.Point(i), radius), any);
    EXPECT_TRUE(stars->sample().AnyWithin(sample.Point(i), 0));
  }
}

TYPED_TEST(StarsTest, ProjectsAndLifts) {
  constexpr int K = TypeParam::kDimension;
  const FramedPoints sample = SampleOfDimension<K>(20, 11);
  const auto stars = Build<K>(sample, TypeParam::kCentreRule);
  std::vector<double> lifted(static_cast<std::size_t>(sample.d));
  double x[K], back[K];
  for (std::uint32_t p = 0; p < sample.size(); ++p) {
    double norm2 = 0;
    for (int a = 0; a < K; ++a) {
      x[a] = 0.1 * (a + 1);
      norm2 += x[a] * x[a];
    }
    stars->sample().Lift(p, x, lifted.data());
    EXPECT_NEAR(stars->sample().Project(p, lifted.data(), back), norm2, 1e-13);
    for (int a = 0; a < K; ++a) EXPECT_NEAR(back[a], x[a], 1e-13);
  }
  const Eigen::MatrixXd bases = stars->sample().TangentMatrix();
  ASSERT_EQ(bases.cols(), sample.size());
  for (std::uint32_t p = 0; p < sample.size(); ++p)
    for (int a = 0; a < K; ++a)
      for (int i = 0; i < sample.d; ++i)
        EXPECT_EQ(bases(i * K + a, p), sample.Tangent(p)[a * sample.d + i]);
}

// All neighbours cospherical: every star could split each cube its own way. The weights, a share of
// epsilon^2, make them agree; epsilon is here what such a sample would be refined to.
TYPED_TEST(StarsTest, StarsOfAGridAgree) {
  constexpr int K = TypeParam::kDimension;
  const int n = K <= 2 ? 24 : K == 3 ? 10 : 6;
  const double circumradius = std::sqrt(K) * std::tan(std::numbers::pi / n);
  const FramedPoints sample = TorusGrid(K, n);
  Stars<K> stars(sample.d, 1.1 * circumradius, StarOptions{kInradius, TypeParam::kCentreRule});
  AppendTo(&stars, sample);
  stars.Commit();
  std::uint64_t unbounded = 0, inconsistent = 0;
  for (std::uint32_t p = 0; p < stars.size(); ++p) {
    unbounded += !stars.cell(p).bounded();
    inconsistent += CountInconsistent(stars, p);
  }
  EXPECT_EQ(unbounded, 0u);
  EXPECT_EQ(inconsistent, 0u);
}

TYPED_TEST(StarsTest, DuplicatePointsDoNoHarm) {
  constexpr int K = TypeParam::kDimension;
  FramedPoints sample = SampleOfDimension<K>(80, 12);
  const FramedPoints once = sample;
  sample.points.insert(sample.points.end(), once.points.begin(), once.points.end());
  sample.tangents.insert(sample.tangents.end(), once.tangents.begin(), once.tangents.end());
  const auto stars = Build<K>(sample, TypeParam::kCentreRule);
  for (std::uint32_t p = 0; p < stars->size(); ++p) {
    EXPECT_GE(stars->cell(p).vertex_count(), K + 1u);
    EXPECT_TRUE(std::isfinite(stars->cell(p).max_norm2()));
  }
}

}  // namespace
}  // namespace stellate::core
