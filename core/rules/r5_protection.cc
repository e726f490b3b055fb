#include "core/rules/r5_protection.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/instantiate.h"
#include "core/base/vector_ops.h"

namespace stellate::core {

namespace {

// The ball of a simplex of a star: its centre, in space, and its circumradius.
struct Ball {
  const double* centre;  // d; good until the next call of BallOf in this thread
  double radius;
};

template <int K>
Ball BallOf(const Site& p, const RestrictedVoronoiCell<K>& cell, std::size_t v, int d) {
  thread_local std::vector<double> centre;
  centre.assign(p.point, p.point + d);
  if (cell.judged(v)) {
    for (int i = 0; i < d; ++i) centre[static_cast<std::size_t>(i)] += cell.Centre(v)[i];
  } else {
    for (int a = 0; a < K; ++a)
      for (int i = 0; i < d; ++i)
        centre[static_cast<std::size_t>(i)] += cell.x(v)[a] * p.tangent[a * d + i];
  }
  return {centre.data(), std::sqrt(cell.norm2(v))};
}

template <int K>
bool HasVertex(std::uint32_t p, const RestrictedVoronoiCell<K>& cell, std::size_t v,
               std::uint32_t q) {
  if (q == p) return true;
  for (int s = 0; s < K; ++s)
    if (cell.id(cell.facet(v, s)) == q) return true;
  return false;
}

// Whether a simplex is tested in star(p): at a common centre one of its stars is enough.
template <int K>
bool IsTestedAt(std::uint32_t p, const RestrictedVoronoiCell<K>& cell, std::size_t v) {
  if (!cell.judged(v)) return true;
  for (int s = 0; s < K; ++s)
    if (cell.id(cell.facet(v, s)) < p) return false;
  return true;
}

// Whether a sample point that is no vertex of the simplex is in its ball or shell.
template <int K>
bool IsWeak(const Stars<K>& stars, std::uint32_t p, const RestrictedVoronoiCell<K>& cell,
            std::size_t v, const Ball& ball, double delta) {
  bool is_weak = false;
  stars.sample().tree().VisitNear(
      ball.centre, [&] { return is_weak ? 0 : ball.radius + delta; },
      [&](std::uint32_t q, double) { is_weak = is_weak || !HasVertex<K>(p, cell, v, q); });
  return is_weak;
}

}  // namespace

template <int K>
std::optional<Violation<K>> WorstUnprotected(const Stars<K>& stars, std::uint32_t p, double delta) {
  const auto& cell = stars.cell(p);
  const Site site = stars.sample().At(p);
  WorstVertex<K> worst(cell);
  for (std::size_t v = 0; v < cell.vertex_count(); ++v)
    if (worst.IsBeatenBy(v, cell.norm2(v)) && IsTestedAt<K>(p, cell, v) &&
        IsWeak<K>(stars, p, cell, v, BallOf<K>(site, cell, v, stars.sample().d()), delta))
      worst.Take(v, cell.norm2(v));
  if (!worst.is_any()) return std::nullopt;
  return ViolationAt<K>(Rule::kProtection, cell, worst.vertex());
}

template <int K>
int CountUnprotected(const Stars<K>& stars, const Site& guest,
                     const typename Stars<K>::Tentative& tentative, double delta, int enough) {
  const int d = stars.sample().d();
  int weak = 0;
  typename Stars<K>::Simplex simplex;
  const auto count_new = [&](const Site& p, const RestrictedVoronoiCell<K>& cell) {
    for (std::size_t v = 0; v < cell.vertex_count() && weak < enough; ++v)
      weak += stars.SimplexOf(p.id, cell, v, &simplex) && simplex.back() == guest.id &&
              (p.id == guest.id || !cell.judged(v)) &&
              IsWeak<K>(stars, p.id, cell, v, BallOf<K>(p, cell, v, d), delta);
  };
  for (const auto& own : tentative.own) count_new(guest, own);
  for (const auto& cut : tentative.cut) count_new(stars.sample().At(cut.star), cut.cell);
  // A point is no farther from the centre of a shell that it is in than epsilon and delta.
  const double farthest = 2 * stars.sample().epsilon() + delta;
  stars.sample().ForEachWithin(guest.point, farthest, [&](std::uint32_t p) {
    const auto& cell = stars.cell(p);
    const Site site = stars.sample().At(p);
    for (std::size_t v = 0; v < cell.vertex_count() && weak < enough; ++v) {
      if (!IsTestedAt<K>(p, cell, v)) continue;
      const Ball ball = BallOf<K>(site, cell, v, d);
      const double away = Distance(guest.point, ball.centre, d);
      weak += away >= ball.radius && away <= ball.radius + delta;
    }
  });
  return weak;
}

template <int K>
int CountResolved(const Stars<K>& stars, const Site& guest,
                  const typename Stars<K>::Tentative& tentative, double delta) {
  const int d = stars.sample().d();
  int resolved = 0;
  for (const auto& cut : tentative.cut) {
    const auto& cell = stars.cell(cut.star);
    const Site site = stars.sample().At(cut.star);
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      if (!IsTestedAt<K>(cut.star, cell, v)) continue;
      const Ball ball = BallOf<K>(site, cell, v, d);
      resolved += Distance(guest.point, ball.centre, d) < ball.radius &&
                  IsWeak<K>(stars, cut.star, cell, v, ball, delta);
    }
  }
  return resolved;
}

#define STELLATE_EACH(K)                                                                          \
  template std::optional<Violation<K>> WorstUnprotected(const Stars<K>&, std::uint32_t, double);  \
  template int CountUnprotected(const Stars<K>&, const Site&, const Stars<K>::Tentative&, double, \
                                int);                                                             \
  template int CountResolved(const Stars<K>&, const Site&, const Stars<K>::Tentative&, double);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
