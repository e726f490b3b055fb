#include "core/rules/r5_protection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "tests/core/support/in_process_run.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::FramedPoints;
using testing::Make;

struct Shell {
  std::vector<double> centre;
  double inner, outer;

  bool Holds(const double* q) const {
    const double away = Distance(q, centre.data(), static_cast<int>(centre.size()));
    return away >= inner && away <= outer;
  }
};

template <int K>
Shell ShellOf(const Stars<K>& stars, std::uint32_t p, std::size_t v, double delta) {
  std::vector<double> centre(static_cast<std::size_t>(stars.sample().d()));
  const auto& cell = stars.cell(p);
  stars.sample().Lift(p, cell.x(v), centre.data());
  const double radius = Distance(centre.data(), stars.sample().Point(p), stars.sample().d());
  return {centre, radius, radius + delta};
}

template <int K>
std::unique_ptr<Stars<K>> StarsOf(const FramedPoints& sample, double epsilon) {
  auto stars = std::make_unique<Stars<K>>(sample.d, epsilon,
                                          StarOptions{8 * epsilon, CentreRule::kTangentSpace});
  testing::AppendTo(stars.get(), sample);
  stars->Commit();
  return stars;
}

// The simplices of all stars with a point but their own in the ball or shell; of those, the ones
// that hold `guest` or have it there.
template <int K>
int CountWeak(const Stars<K>& stars, double delta, std::uint32_t guest, std::vector<bool>* weak) {
  int of_guest = 0;
  weak->assign(stars.size(), false);
  for (std::uint32_t p = 0; p < stars.size(); ++p)
    for (std::size_t v = 0; v < stars.cell(p).vertex_count(); ++v) {
      typename Stars<K>::Simplex simplex;
      if (!stars.SimplexOf(p, stars.cell(p), v, &simplex)) continue;
      const Shell shell = ShellOf<K>(stars, p, v, delta);
      const auto is_own = [&](std::uint32_t q) {
        return std::find(simplex.begin(), simplex.end(), q) != simplex.end();
      };
      bool any = false;
      for (std::uint32_t q = 0; q < stars.size(); ++q)
        any = any || (!is_own(q) && Distance(stars.sample().Point(q), shell.centre.data(),
                                             stars.sample().d()) <= shell.outer);
      (*weak)[p] = (*weak)[p] || any;
      of_guest +=
          guest < stars.size() && (is_own(guest) ? any : shell.Holds(stars.sample().Point(guest)));
    }
  return of_guest;
}

// delta: a share of epsilon.
template <int K>
void ExpectByDefinition(const std::string& name, double epsilon, double share) {
  const auto manifold = Make(name);
  Specification spec = testing::SpecificationFor(*manifold, epsilon);
  spec.criteria.centre_rule = CentreRule::kTangentSpace;
  const testing::DrivenRun run = testing::Drive(spec, *manifold);
  ASSERT_TRUE(run.report().certificate.certified) << run.report().certificate.verdict;
  FramedPoints mesh;
  mesh.d = spec.ambient_dimension;
  mesh.k = K;
  mesh.Append(run.mesher->Points(), run.mesher->Tangents());
  const auto stars = StarsOf<K>(mesh, epsilon);
  const double delta = share * epsilon;
  std::vector<bool> weak;
  CountWeak<K>(*stars, delta, stars->size(), &weak);
  for (std::uint32_t p = 0; p < stars->size(); ++p)
    EXPECT_EQ(WorstUnprotected<K>(*stars, p, delta).has_value(), weak[p]) << "star " << p;
  EXPECT_TRUE(K == 1 || std::count(weak.begin(), weak.end(), true) > 0);
  EXPECT_GT(std::count(weak.begin(), weak.end(), false), 0);

  const FramedPoints candidates = testing::RandomSample(*manifold, 12, 10);
  typename Stars<K>::Tentative tentative;
  int most = 0;
  for (std::uint32_t c = 0; c < candidates.size(); ++c) {
    const Site guest{stars->size(), candidates.Point(c), candidates.Tangent(c)};
    stars->TryPoint(guest.point, guest.tangent, Stars<K>::kNone, &tentative);
    FramedPoints grown = mesh;
    grown.points.insert(grown.points.end(), guest.point, guest.point + mesh.d);
    grown.tangents.insert(grown.tangents.end(), guest.tangent, guest.tangent + mesh.d * K);
    const int want = CountWeak<K>(*StarsOf<K>(grown, epsilon), delta, stars->size(), &weak);
    for (const int enough : {1, 3, 1'000'000})
      EXPECT_EQ(CountUnprotected<K>(*stars, guest, tentative, delta, enough),
                std::min(want, enough))
          << "candidate " << c;
    most = std::max(most, want);
  }
  EXPECT_GT(most, 0);
}

TEST(RuleR5Protection, IsByTheBallsAndShellsOfAllStars) {
  ExpectByDefinition<1>("torus-knot:2:3", 0.3, 0.08);
  ExpectByDefinition<2>("torus", 0.3, 0.08);
  ExpectByDefinition<2>("clifford-torus", 0.6, 0.08);
  ExpectByDefinition<3>("sphere:3", 0.8, 0.004);
}

}  // namespace
}  // namespace stellate::core
