#include "core/rules/rules.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "core/complex/consistency.h"
#include "core/geometry/simplex.h"
#include "core/rules/count_bad.h"
#include "tests/core/support/in_process_run.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::AppendTo;
using testing::FramedPoints;
using testing::Make;
using testing::RandomSample;
using testing::StarOf;

template <int K>
using Simplex = typename Stars<K>::Simplex;

template <int K>
std::unique_ptr<Stars<K>> Build(const FramedPoints& sample) {
  auto stars =
      std::make_unique<Stars<K>>(sample.d, 0.3, StarOptions{3.0, CentreRule::kTangentSpace});
  AppendTo(stars.get(), sample);
  stars->Commit();
  return stars;
}

std::vector<const double*> Vertices(const FramedPoints& sample,
                                    const std::vector<std::uint32_t>& ids) {
  std::vector<const double*> vertices;
  for (const std::uint32_t id : ids) vertices.push_back(sample.Point(id));
  return vertices;
}

// Whether a face at p of dimension 2 or more is not Theta0-fat, face by face.
bool HasThinFaceAt(const FramedPoints& sample, const std::vector<std::uint32_t>& simplex,
                   std::uint32_t p, double theta0) {
  for (unsigned subset = 1; subset < (1u << simplex.size()); ++subset) {
    std::vector<std::uint32_t> face;
    for (std::size_t s = 0; s < simplex.size(); ++s)
      if (subset >> s & 1) face.push_back(simplex[s]);
    if (face.size() < 3 || std::find(face.begin(), face.end(), p) == face.end()) continue;
    if (!IsFat(Vertices(sample, face), sample.d, theta0)) return true;
  }
  return false;
}

template <int K>
bool IsInStars(const Stars<K>& stars, const Simplex<K>& simplex) {
  return std::all_of(simplex.begin(), simplex.end(),
                     [&](std::uint32_t q) { return StarOf(stars, q).contains(simplex); });
}

// Stars that break R1, those that break R2 alone, those that break neither, and fakes among the
// first.
struct SizesAndShapes {
  int sizes = 0, shapes = 0, fine = 0, fakes = 0;
};

// Expects of each star the worst simplex of the first rule broken.
void ExpectWorst(SizesAndShapes* seen) {
  // In a plane the circumradius in T_p is that of the triangle.
  const FramedPoints sample = testing::FlatSample(2, 3, 400, 1);
  const auto stars = Build<2>(sample);
  for (const double epsilon : {0.03, 0.1, 5.0}) {
    for (const double rho0 : {1.2, 6.0}) {
      for (std::uint32_t p = 0; p < stars->size(); ++p) {
        const auto got = WorstSizeOrShape<2>(*stars, p, epsilon, rho0);
        if (!stars->cell(p).bounded()) {
          ASSERT_TRUE(got.has_value());
          EXPECT_EQ(got->rule, Rule::kSize);
          EXPECT_NEAR(got->radius, std::hypot(got->x[0], got->x[1]), 1e-12);
          seen->fakes += got->fake;
          continue;
        }
        double largest = 0, worst_rho = 0;
        for (const auto& s : StarOf(*stars, p)) {
          const SimplexMeasures m = MeasureSimplex(Vertices(sample, {s[0], s[1], s[2]}), sample.d);
          largest = std::max(largest, m.circumradius);
          double edge = INFINITY;
          for (const std::uint32_t q : s)
            if (q != p) edge = std::min(edge, Distance(sample.Point(p), sample.Point(q), 3));
          worst_rho = std::max(worst_rho, m.circumradius / edge);
        }
        if (largest > epsilon) {
          ASSERT_TRUE(got.has_value());
          EXPECT_EQ(got->rule, Rule::kSize);
          EXPECT_NEAR(got->radius, largest, 1e-6 * largest);
          ++seen->sizes;
        } else if (worst_rho > rho0) {
          ASSERT_TRUE(got.has_value());
          EXPECT_EQ(got->rule, Rule::kRadiusEdge);
          EXPECT_LE(got->radius, epsilon);
          ++seen->shapes;
        } else {
          EXPECT_FALSE(got.has_value());
          ++seen->fine;
        }
        if (got) {
          EXPECT_FALSE(got->fake);
          EXPECT_NEAR(got->radius, std::hypot(got->x[0], got->x[1]), 1e-12);
        }
      }
    }
  }
}

TEST(RuleR1Size, GivesTheLargestSimplexThatIsTooLarge) {
  SizesAndShapes seen;
  ExpectWorst(&seen);
  EXPECT_GT(seen.sizes, 50);
  EXPECT_GT(seen.fakes, 10);
}

TEST(RuleR2RadiusEdge, GivesTheWorstSimplexWhereNoneIsTooLarge) {
  SizesAndShapes seen;
  ExpectWorst(&seen);
  EXPECT_GT(seen.shapes, 50);
  EXPECT_GT(seen.fine, 50);
}

template <int K>
void ExpectSliversAsMeasured(const FramedPoints& sample) {
  const auto stars = Build<K>(sample);
  int thin = 0, fat = 0;
  for (const double theta0 : {0.1, 0.2, 0.3}) {
    for (std::uint32_t p = 0; p < stars->size(); ++p) {
      for (std::size_t v = 0; v < stars->cell(p).vertex_count(); ++v) {
        Simplex<K> s;
        if (!stars->SimplexOf(p, stars->cell(p), v, &s)) continue;
        const bool expected = HasThinFaceAt(sample, {s.begin(), s.end()}, p, theta0);
        EXPECT_EQ(HasThinFaceAt<K>(*stars, sample.Point(p), stars->cell(p), v, theta0, nullptr),
                  expected);
        ++(expected ? thin : fat);
        EXPECT_FALSE(HasThinFaceAt<K>(*stars, sample.Point(p), stars->cell(p), v, 0, nullptr));
      }
    }
  }
  EXPECT_GT(thin, 20);
  EXPECT_GT(fat, 20);
}

TEST(RuleR3Slivers, AreTheThinFacesAtTheStarsPoint) {
  ExpectSliversAsMeasured<2>(RandomSample(*Make("torus"), 200, 2));
  ExpectSliversAsMeasured<3>(RandomSample(*Make("so3"), 200, 3));
  ExpectSliversAsMeasured<4>(RandomSample(*Make("sphere:4:6"), 80, 4));
}

// All stars together see every sliver that the simplex has.
TEST(RuleR3Slivers, AreSeenFromSomeVertexOfTheSimplex) {
  const FramedPoints sample = RandomSample(*Make("flat-torus:3"), 250, 5);
  const auto stars = Build<3>(sample);
  int slivers = 0;
  for (std::uint32_t p = 0; p < stars->size(); ++p) {
    for (const auto& s : StarOf(*stars, p)) {
      if (s[0] != p || !IsInStars(*stars, s)) continue;
      std::uint64_t key = 0;
      for (const std::uint32_t q : s) key += Mix64(q);
      bool seen = false;
      for (const std::uint32_t q : s) {
        const auto v = FindSimplex<3>(stars->cell(q), q, s, key);
        ASSERT_TRUE(v.has_value());
        seen = seen || HasThinFaceAt<3>(*stars, sample.Point(q), stars->cell(q), *v, 0.2, nullptr);
      }
      const std::vector<std::uint32_t> ids(s.begin(), s.end());
      EXPECT_EQ(seen, ContainsSliver(Vertices(sample, ids), sample.d, 0.2));
      slivers += seen;
    }
  }
  EXPECT_GT(slivers, 10);
}

TEST(FindSimplex, FindsWhatTheStarHoldsAndNothingElse) {
  const FramedPoints sample = RandomSample(*Make("torus"), 150, 6);
  const auto stars = Build<2>(sample);
  for (std::uint32_t p = 0; p < stars->size(); ++p) {
    for (const auto& s : StarOf(*stars, p)) {
      std::uint64_t key = 0;
      for (const std::uint32_t q : s) key += Mix64(q);
      for (const std::uint32_t q : s) {
        const auto v = FindSimplex<2>(stars->cell(q), q, s, key);
        EXPECT_EQ(v.has_value(), StarOf(*stars, q).contains(s));
        Simplex<2> found;
        if (!v) continue;
        ASSERT_TRUE(stars->SimplexOf(q, stars->cell(q), *v, &found));
        EXPECT_EQ(found, s);
      }
      Simplex<2> other = s;
      other[2] = (other[2] + 1) % stars->size();
      if (std::find(s.begin(), s.end(), other[2]) == s.end()) {
        const std::uint64_t other_key = key - Mix64(s[2]) + Mix64(other[2]);
        std::sort(other.begin(), other.end());
        EXPECT_EQ(FindSimplex<2>(stars->cell(p), p, other, other_key).has_value(),
                  StarOf(*stars, p).contains(other));
      }
    }
  }
}

template <int K>
void ExpectConsistencyByDefinition(const FramedPoints& sample, double sliver_bound) {
  const auto stars = Build<K>(sample);
  const ConsistentSimplices<K> known(*stars);
  std::uint64_t inconsistent = 0, slivers = 0, fine = 0;
  for (std::uint32_t p = 0; p < stars->size(); ++p) {
    std::uint64_t expected = 0;
    double worst_sliver = 0, worst_inconsistent = 0;
    for (std::size_t v = 0; v < stars->cell(p).vertex_count(); ++v) {
      const double radius = std::sqrt(stars->cell(p).norm2(v));
      Simplex<K> s;
      const bool real = stars->SimplexOf(p, stars->cell(p), v, &s);
      // Slivers are judged in the star of their lowest vertex.
      if (real && s[0] == p &&
          HasThinFaceAt<K>(*stars, sample.Point(p), stars->cell(p), v, sliver_bound, nullptr))
        worst_sliver = std::max(worst_sliver, radius);
      const bool consistent = real && IsInStars(*stars, s);
      ASSERT_LT(v, 64u);
      EXPECT_EQ((known.Of(p) >> v & 1) != 0, consistent) << "star " << p;
      if (!consistent) {
        ++expected;
        worst_inconsistent = std::max(worst_inconsistent, radius);
      }
    }
    EXPECT_EQ(CountInconsistent<K>(*stars, p), expected) << "star " << p;
    const auto got = WorstSliverOrInconsistent<K>(*stars, p, {sliver_bound}, 0.3, K, known.Of(p));
    if (!stars->cell(p).bounded()) {  // R1's, not yet to be judged by others
      EXPECT_FALSE(got) << "star " << p;
      inconsistent += expected > 0;
      continue;
    }
    ASSERT_EQ(got.has_value(), worst_sliver > 0 || expected > 0) << "star " << p;
    if (!got) {
      ++fine;
      continue;
    }
    EXPECT_EQ(got->rule, worst_sliver > 0 ? Rule::kShape : Rule::kInconsistent);
    EXPECT_EQ(got->radius, worst_sliver > 0 ? worst_sliver : worst_inconsistent);
    ++(worst_sliver > 0 ? slivers : inconsistent);
  }
  EXPECT_GT(inconsistent, 0u);
  EXPECT_EQ(slivers > 0, sliver_bound > 0);
  if (K == 2 && sliver_bound == 0) {
    EXPECT_GT(fine, 0u);
  }
}

TEST(RuleR4Consistency, IsMembershipInTheStarsOfAllVertices) {
  ExpectConsistencyByDefinition<1>(RandomSample(*Make("torus-knot:2:3"), 40, 7), 0);
  ExpectConsistencyByDefinition<2>(RandomSample(*Make("torus"), 300, 8), 0);
  ExpectConsistencyByDefinition<2>(RandomSample(*Make("torus"), 300, 8), 0.2);
  ExpectConsistencyByDefinition<3>(RandomSample(*Make("flat-torus:3"), 150, 9), 0);
  ExpectConsistencyByDefinition<3>(RandomSample(*Make("flat-torus:3"), 150, 9), 0.15);
}

// Into a mesh without a violation: a candidate that counts no bad simplex leaves none, and one that
// leaves some counts them.
template <int K>
void ExpectBadCountedRightly(const std::string& name, double epsilon) {
  const auto manifold = Make(name);
  Specification spec = testing::SpecificationFor(*manifold, epsilon);
  spec.criteria.centre_rule = CentreRule::kTangentSpace;
  const testing::DrivenRun run = testing::Drive(spec, *manifold);
  ASSERT_TRUE(run.report().certificate.certified) << run.report().certificate.verdict;
  FramedPoints mesh;
  mesh.d = spec.ambient_dimension;
  mesh.k = K;
  mesh.Append(run.mesher->Points(), run.mesher->Tangents());
  const FramedPoints candidates = RandomSample(*manifold, 60, 10);
  const auto stars = Build<K>(mesh);
  typename Stars<K>::Tentative tentative;
  int good = 0, bad = 0;
  for (std::uint32_t c = 0; c < candidates.size(); ++c) {
    const double* point = candidates.Point(c);
    stars->TryPoint(point, candidates.Tangent(c), Stars<K>::kNone, &tentative);
    const Site guest{stars->size(), point, candidates.Tangent(c)};
    const int count = CountBad<K>(*stars, guest, tentative, {}, epsilon, 1'000'000);
    for (const int enough : {0, 1, 2})
      EXPECT_EQ(CountBad<K>(*stars, guest, tentative, {}, epsilon, enough),
                std::min(count, enough));
    // A bound that every new simplex fails counts no fewer.
    const ShapeBounds thick{K >= 2 ? 0.3 : 0};
    EXPECT_GE(CountBad<K>(*stars, guest, tentative, thick, epsilon, 1'000'000), count);

    FramedPoints grown = mesh;
    grown.points.insert(grown.points.end(), point, point + mesh.d);
    grown.tangents.insert(grown.tangents.end(), candidates.Tangent(c),
                          candidates.Tangent(c) + mesh.d * K);
    const auto after = Build<K>(grown);
    std::uint64_t inconsistent = 0;
    for (std::uint32_t p = 0; p < after->size(); ++p)
      inconsistent += CountInconsistent<K>(*after, p);
    EXPECT_EQ(count == 0, inconsistent == 0) << "candidate " << c;
    ++(count == 0 ? good : bad);
  }
  EXPECT_GT(good, 0);
  if (K >= 2) {
    EXPECT_GT(bad, 0);
  }
}

TEST(GoodPoints, AreThoseThatLeaveNothingBad) {
  ExpectBadCountedRightly<1>("torus-knot:2:3", 0.2);
  ExpectBadCountedRightly<2>("rp2", 0.4);
  ExpectBadCountedRightly<3>("so3", 0.8);
}

}  // namespace
}  // namespace stellate::core
