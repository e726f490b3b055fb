#include "core/complex/star_complex.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <set>
#include <vector>

#include "core/refinement/rules.h"
#include "tests/core/support/cells.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::AppendTo;
using testing::AsSet;
using testing::Canonical;
using testing::CombinatoricsHold;
using testing::GivenHalfSpaces;
using testing::Make;
using testing::RandomSample;
using testing::Sample;
using testing::StarOf;
using testing::TorusGrid;

constexpr double kEpsilon = 0.3;
constexpr double kInradius = 3;

template <int K>
std::unique_ptr<StarComplex<K>> NewComplex(int d, Judging judging) {
  return std::make_unique<StarComplex<K>>(d, kEpsilon, kInradius, judging);
}

template <int K>
std::unique_ptr<StarComplex<K>> Build(const Sample& sample, Judging judging = Judging::kFlats) {
  auto complex = NewComplex<K>(sample.d, judging);
  AppendTo(complex.get(), sample);
  complex->Commit();
  return complex;
}

template <int K>
Sample SampleOfDimension(int count, std::uint64_t seed) {
  const char* names[] = {"", "torus-knot:2:3", "torus:1:0.4", "so3", "sphere:4:6"};
  return RandomSample(*Make(names[K]), count, seed);
}

template <typename T>
class StarComplexTest : public ::testing::Test {};

// k, and where simplices are judged: what follows holds for both unless it says otherwise.
template <int K, Judging J>
struct Judged {
  static constexpr int kDimension = K;
  static constexpr Judging kJudging = J;
};
using Cases =
    ::testing::Types<Judged<1, Judging::kFlats>, Judged<2, Judging::kFlats>,
                     Judged<3, Judging::kFlats>, Judged<4, Judging::kFlats>,
                     Judged<2, Judging::kCommonCentre>, Judged<3, Judging::kCommonCentre>>;
TYPED_TEST_SUITE(StarComplexTest, Cases);

TYPED_TEST(StarComplexTest, ClipsEachCellByAllThatMatter) {
  constexpr int K = TypeParam::kDimension;
  if (TypeParam::kJudging != Judging::kFlats) return SUCCEED();  // other cells are not polytopes
  const Sample sample = SampleOfDimension<K>(K == 4 ? 120 : 250, 1);
  const auto complex = Build<K>(sample);
  ASSERT_EQ(complex->size(), sample.size());
  for (std::uint32_t p = 0; p < sample.size(); ++p) {
    // By the definition: cut by every other point, in the order of their ids.
    typename StarComplex<K>::Cell cell;
    GivenHalfSpaces<K> given(kInradius);
    cell.Reset(kInradius, given);
    for (std::uint32_t q = 0; q < sample.size(); ++q) {
      if (q == p) continue;
      double normal[K];
      const double distance2 = complex->Project(p, sample.Point(q), normal);
      given.Clip(cell, q, normal, 0.5 * distance2);
    }
    const auto expected = Canonical(cell), got = Canonical(complex->cell(p));
    ASSERT_EQ(got.size(), expected.size()) << "star " << p;
    for (const auto& [ids, bits] : expected) {
      const auto at = got.find(ids);
      ASSERT_NE(at, got.end()) << "star " << p;
      for (std::size_t a = 0; a < K; ++a)
        EXPECT_NEAR(std::bit_cast<double>(at->second[a]), std::bit_cast<double>(bits[a]), 1e-6);
    }
    EXPECT_TRUE(CombinatoricsHold(complex->cell(p)));
  }
}

// Lemma 2.4.2 read backwards: the vertex, lifted into T_pM, is equidistant in R^d from the vertices
// of its simplex, and no sample point is nearer.
TYPED_TEST(StarComplexTest, HasCircumcentresOfEmptyBalls) {
  constexpr int K = TypeParam::kDimension;
  if (TypeParam::kJudging != Judging::kFlats) return SUCCEED();
  const Sample sample = SampleOfDimension<K>(K == 4 ? 120 : 250, 2);
  const auto complex = Build<K>(sample);
  std::vector<double> centre(static_cast<std::size_t>(sample.d));
  int simplices = 0;
  for (std::uint32_t p = 0; p < sample.size(); ++p) {
    const auto& cell = complex->cell(p);
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      complex->Lift(p, cell.x(v), centre.data());
      const double norm2 = cell.norm2(v);
      const double tolerance = 1e-8 * (1 + norm2);
      for (std::uint32_t q = 0; q < sample.size(); ++q)
        EXPECT_GE(SquaredDistance(centre.data(), sample.Point(q), sample.d), norm2 - tolerance);
      typename StarComplex<K>::Simplex simplex;
      if (!complex->SimplexOf(p, complex->cell(p), v, &simplex)) continue;
      ++simplices;
      EXPECT_TRUE(std::is_sorted(simplex.begin(), simplex.end()));
      EXPECT_TRUE(std::binary_search(simplex.begin(), simplex.end(), p));
      for (const std::uint32_t q : simplex)
        EXPECT_NEAR(SquaredDistance(centre.data(), sample.Point(q), sample.d), norm2, tolerance);
    }
  }
  EXPECT_GT(simplices, 100);
}

TYPED_TEST(StarComplexTest, IsTheSameFromOneBatchOrManyOrOneByOne) {
  constexpr int K = TypeParam::kDimension;
  if (TypeParam::kJudging != Judging::kFlats) return SUCCEED();
  const Sample sample = SampleOfDimension<K>(K == 4 ? 100 : 300, 3);
  const auto at_once = Build<K>(sample);
  for (const std::uint32_t batch : {1u, 17u}) {
    auto complex = NewComplex<K>(sample.d, Judging::kFlats);
    for (std::uint32_t i = 0; i < sample.size(); ++i) {
      complex->Append(sample.Point(i), sample.Tangent(i));
      if (i % batch == batch - 1) complex->Commit();
    }
    complex->Commit();
    for (std::uint32_t p = 0; p < sample.size(); ++p)
      EXPECT_EQ(Canonical(complex->cell(p)), Canonical(at_once->cell(p))) << "star " << p;
    EXPECT_EQ(complex->Simplices(), at_once->Simplices());
  }
}

// A sample laid at once has the stars that it has when it is appended, and takes further points.
TYPED_TEST(StarComplexTest, IsTheSameLaidAtOnceOrAppended) {
  constexpr int K = TypeParam::kDimension;
  if (TypeParam::kJudging != Judging::kFlats) return SUCCEED();
  const Sample sample = SampleOfDimension<K>(K == 4 ? 100 : 300, 5);
  const std::uint32_t laid = sample.size() - 20;
  auto complex = NewComplex<K>(sample.d, Judging::kFlats);
  auto appended = NewComplex<K>(sample.d, Judging::kFlats);
  auto graded = NewComplex<K>(sample.d, Judging::kFlats);
  Random random(5, 0);
  for (std::uint32_t i = 0; i < laid; ++i) {
    complex->Lay(sample.Point(i), sample.Tangent(i));
    graded->Lay(sample.Point(i), sample.Tangent(i));
    graded->LaidAt(0.3 * random.Uniform());
    appended->Append(sample.Point(i), sample.Tangent(i));
  }
  const auto change = complex->Commit();
  EXPECT_TRUE(change.stars.empty());
  EXPECT_TRUE(change.removed.empty());
  EXPECT_EQ(AsSet<K>(change.added), AsSet<K>(appended->Commit().added));
  EXPECT_EQ(change.added, graded->Commit().added);
  for (int last = 0; last < 2; ++last) {
    for (std::uint32_t p = 0; p < complex->size(); ++p)
      EXPECT_EQ(Canonical(complex->cell(p)), Canonical(appended->cell(p))) << "star " << p;
    EXPECT_EQ(complex->Simplices(), appended->Simplices());
    EXPECT_EQ(complex->simplex_count(), appended->simplex_count());
    for (std::uint32_t i = laid; i < sample.size() && last == 0; ++i) {
      complex->Append(sample.Point(i), sample.Tangent(i));
      appended->Append(sample.Point(i), sample.Tangent(i));
    }
    EXPECT_EQ(complex->Commit().stars, appended->Commit().stars);
  }
}

TYPED_TEST(StarComplexTest, DoesNotDependOnTheNumberOfThreads) {
  constexpr int K = TypeParam::kDimension;
  const Sample sample = SampleOfDimension<K>(K == 4 ? 100 : 400, 4);
  const auto build = [&](int threads) {
    auto complex = NewComplex<K>(sample.d, TypeParam::kJudging);
    std::vector<std::vector<std::uint32_t>> changes;
    tbb::task_arena(threads).execute([&] {
      for (std::uint32_t i = 0; i < sample.size(); ++i) {
        complex->Append(sample.Point(i), sample.Tangent(i));
        if (i % 50 != 49) continue;
        auto change = complex->Commit();
        changes.insert(changes.end(), {change.stars, change.added, change.removed});
      }
    });
    return std::make_pair(std::move(complex), changes);
  };
  const auto [one, one_changes] = build(1);
  for (const int threads : {2, 4}) {
    const auto [many, many_changes] = build(threads);
    EXPECT_EQ(many_changes, one_changes);
    for (std::uint32_t p = 0; p < sample.size(); ++p)
      EXPECT_EQ(Canonical(many->cell(p)), Canonical(one->cell(p))) << "star " << p;
  }
}

TYPED_TEST(StarComplexTest, LaidAtOnceDoesNotDependOnTheNumberOfThreads) {
  constexpr int K = TypeParam::kDimension;
  const Sample sample = SampleOfDimension<K>(K == 4 ? 100 : 400, 6);
  const auto build = [&](int threads) {
    auto complex = NewComplex<K>(sample.d, TypeParam::kJudging);
    std::vector<std::uint32_t> added;
    tbb::task_arena(threads).execute([&] {
      for (std::uint32_t i = 0; i < sample.size(); ++i)
        complex->Lay(sample.Point(i), sample.Tangent(i));
      added = complex->Commit().added;
    });
    return std::make_pair(std::move(complex), added);
  };
  const auto [one, one_added] = build(1);
  for (const int threads : {2, 4}) {
    const auto [many, many_added] = build(threads);
    EXPECT_EQ(many_added, one_added);
    for (std::uint32_t p = 0; p < sample.size(); ++p)
      EXPECT_EQ(Canonical(many->cell(p)), Canonical(one->cell(p))) << "star " << p;
  }
}

TYPED_TEST(StarComplexTest, TryPointShowsWhatCommitWouldDo) {
  constexpr int K = TypeParam::kDimension;
  const Sample sample = SampleOfDimension<K>(K == 4 ? 100 : 200, 5);
  const Sample more = SampleOfDimension<K>(K == 4 ? 10 : 40, 6);
  auto complex = Build<K>(sample, TypeParam::kJudging);
  typename StarComplex<K>::Cell::Scratch scratch;
  typename StarComplex<K>::Tentative tentative;
  for (std::uint32_t i = 0; i < more.size(); ++i) {
    const std::uint32_t size = complex->size();
    const auto simplices = complex->Simplices();
    // With the star that it lies next to known, or not.
    std::pair<double, std::uint32_t> nearest;
    complex->Nearest(more.Point(i), 1, &nearest);
    const std::uint32_t near = i % 2 == 0 ? nearest.second : StarComplex<K>::kNone;
    complex->TryPoint(more.Point(i), more.Tangent(i), near, scratch, &tentative);
    EXPECT_EQ(complex->size(), size);
    EXPECT_EQ(complex->Simplices(), simplices);

    ASSERT_EQ(complex->Append(more.Point(i), more.Tangent(i), near), size);
    const auto change = complex->Commit();
    EXPECT_EQ(Canonical(complex->cell(size)), Canonical(tentative.own));
    std::vector<std::uint32_t> cut;
    for (const auto& [p, cell] : tentative.cut) {
      cut.push_back(p);
      EXPECT_EQ(Canonical(complex->cell(p)), Canonical(cell)) << "star " << p;
    }
    EXPECT_EQ(cut, change.stars);
  }
}

TYPED_TEST(StarComplexTest, ChangesAddUpToTheComplex) {
  constexpr int K = TypeParam::kDimension;
  const Sample sample = SampleOfDimension<K>(K == 4 ? 100 : 300, 7);
  auto complex = NewComplex<K>(sample.d, TypeParam::kJudging);
  std::set<typename StarComplex<K>::Simplex> replayed;
  for (std::uint32_t i = 0; i < sample.size(); ++i) {
    complex->Append(sample.Point(i), sample.Tangent(i));
    if (i % 13 != 12 && i + 1 != sample.size()) continue;
    std::vector<std::map<std::array<std::uint32_t, K>, std::array<std::uint64_t, K>>> before;
    const std::uint32_t old_size = i / 13 * 13;
    for (std::uint32_t p = 0; p < old_size; ++p) before.push_back(Canonical(complex->cell(p)));

    std::vector<std::uint32_t> around;
    const auto change = complex->Commit(&around);
    for (const auto& s : AsSet<K>(change.removed)) EXPECT_EQ(replayed.erase(s), 1u);
    for (const auto& s : AsSet<K>(change.added)) EXPECT_TRUE(replayed.insert(s).second);
    EXPECT_EQ(replayed, AsSet<K>(complex->Simplices()));
    EXPECT_EQ(complex->simplex_count(), replayed.size());

    std::vector<std::uint32_t> changed;
    for (std::uint32_t p = 0; p < old_size; ++p)
      if (Canonical(complex->cell(p)) != before[p]) changed.push_back(p);
    std::vector<std::uint32_t> stars = change.stars;
    std::sort(stars.begin(), stars.end());
    EXPECT_EQ(stars, changed);
    const std::set<std::uint32_t> listed(around.begin(), around.end());
    for (const std::uint32_t p : changed) {
      for (const auto& [ids, bits] : before[p])
        for (const std::uint32_t q : ids) EXPECT_TRUE(IsFake(q) || listed.contains(q));
      const auto& cell = complex->cell(p);
      for (std::size_t f = 0; f < cell.facet_count(); ++f)
        EXPECT_TRUE(IsFake(cell.id(f)) || listed.contains(cell.id(f)));
    }
  }
  EXPECT_TRUE(complex->Commit().stars.empty());  // nothing was appended
}

TYPED_TEST(StarComplexTest, SimplicesAreThoseOfTheirLowestVertexInOrder) {
  constexpr int K = TypeParam::kDimension;
  const auto complex = Build<K>(SampleOfDimension<K>(100, 8), TypeParam::kJudging);
  std::vector<std::uint32_t> expected;
  for (std::uint32_t p = 0; p < complex->size(); ++p)
    for (const auto& s : StarOf(*complex, p))
      if (s[0] == p) expected.insert(expected.end(), s.begin(), s.end());
  EXPECT_EQ(complex->Simplices(), expected);
}

TYPED_TEST(StarComplexTest, FindsPointsWithinARadiusAlsoBeforeCommit) {
  constexpr int K = TypeParam::kDimension;
  const Sample sample = SampleOfDimension<K>(60, 9);
  const Sample probes = SampleOfDimension<K>(60, 10);
  auto complex = NewComplex<K>(sample.d, TypeParam::kJudging);
  for (std::uint32_t i = 0; i < sample.size(); ++i) {
    complex->Append(sample.Point(i), sample.Tangent(i));
    if (i == 30) complex->Commit();
    const double radius = 0.05 * (1 + i % 10);
    bool any = false;
    for (std::uint32_t j = 0; j <= i; ++j)
      any = any || Distance(probes.Point(i), sample.Point(j), sample.d) <= radius;
    EXPECT_EQ(complex->AnyWithin(probes.Point(i), radius), any);
    EXPECT_TRUE(complex->AnyWithin(sample.Point(i), 0));
  }
}

TYPED_TEST(StarComplexTest, ProjectsAndLifts) {
  constexpr int K = TypeParam::kDimension;
  const Sample sample = SampleOfDimension<K>(20, 11);
  const auto complex = Build<K>(sample, TypeParam::kJudging);
  std::vector<double> lifted(static_cast<std::size_t>(sample.d));
  double x[K], back[K];
  for (std::uint32_t p = 0; p < sample.size(); ++p) {
    double norm2 = 0;
    for (int a = 0; a < K; ++a) {
      x[a] = 0.1 * (a + 1);
      norm2 += x[a] * x[a];
    }
    complex->Lift(p, x, lifted.data());
    EXPECT_NEAR(complex->Project(p, lifted.data(), back), norm2, 1e-13);
    for (int a = 0; a < K; ++a) EXPECT_NEAR(back[a], x[a], 1e-13);
  }
  const Eigen::MatrixXd bases = complex->TangentMatrix();
  ASSERT_EQ(bases.cols(), sample.size());
  for (std::uint32_t p = 0; p < sample.size(); ++p)
    for (int a = 0; a < K; ++a)
      for (int i = 0; i < sample.d; ++i)
        EXPECT_EQ(bases(i * K + a, p), sample.Tangent(p)[a * sample.d + i]);
}

// All neighbours cospherical: every star could split each cube its own way. The weights, a share of
// epsilon^2, make them agree; epsilon is here what such a sample would be refined to.
TYPED_TEST(StarComplexTest, StarsOfAGridAgree) {
  constexpr int K = TypeParam::kDimension;
  const int n = K <= 2 ? 24 : K == 3 ? 10 : 6;
  const double circumradius = std::sqrt(K) * std::tan(std::numbers::pi / n);
  const Sample sample = TorusGrid(K, n);
  StarComplex<K> complex(sample.d, 1.1 * circumradius, kInradius, TypeParam::kJudging);
  AppendTo(&complex, sample);
  complex.Commit();
  std::uint64_t unbounded = 0, inconsistent = 0;
  for (std::uint32_t p = 0; p < complex.size(); ++p) {
    unbounded += !complex.cell(p).bounded();
    inconsistent += CountInconsistent(complex, p);
  }
  EXPECT_EQ(unbounded, 0u);
  EXPECT_EQ(inconsistent, 0u);
}

TYPED_TEST(StarComplexTest, DuplicatePointsDoNoHarm) {
  constexpr int K = TypeParam::kDimension;
  Sample sample = SampleOfDimension<K>(80, 12);
  const Sample once = sample;
  sample.points.insert(sample.points.end(), once.points.begin(), once.points.end());
  sample.tangents.insert(sample.tangents.end(), once.tangents.begin(), once.tangents.end());
  const auto complex = Build<K>(sample, TypeParam::kJudging);
  for (std::uint32_t p = 0; p < complex->size(); ++p) {
    EXPECT_GE(complex->cell(p).vertex_count(), K + 1u);
    EXPECT_TRUE(std::isfinite(complex->cell(p).max_norm2()));
  }
}

}  // namespace
}  // namespace stellate::core
