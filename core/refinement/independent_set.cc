#include "core/refinement/independent_set.h"

#include <algorithm>

#include "core/parallel.h"
#include "core/sample/ball_tree.h"

namespace stellate::core {

template <int K>
std::vector<Target<K>> SelectIndependent(const StarComplex<K>& complex,
                                         std::vector<Target<K>> targets, std::size_t most) {
  std::sort(targets.begin(), targets.end(), [](const Target<K>& a, const Target<K>& b) {
    if (a.violation.rule != b.violation.rule) return a.violation.rule < b.violation.rule;
    if (a.radius != b.radius) return a.radius > b.radius;
    return a.star < b.star;
  });
  std::vector<Target<K>> chosen;
  std::vector<double> centres;
  const auto d = static_cast<std::size_t>(complex.d());
  BallTree balls(complex.d(), &centres);
  std::vector<double> centre(d);
  for (const Target<K>& t : targets) {
    if (chosen.size() == most) break;
    if (chosen.size() % 1024 == 0) ThrowIfInterrupted();
    complex.Lift(t.star, t.x, centre.data());
    bool conflict = false;
    balls.ForEachInfluencing(centre.data(), [&](std::uint32_t) { conflict = true; });
    if (conflict) continue;
    centres.insert(centres.end(), centre.begin(), centre.end());
    balls.Insert(t.violation.rule >= Rule::kSliver ? 2 * t.radius : t.radius);
    chosen.push_back(t);
  }
  std::vector<Target<K>> ordered;
  ordered.reserve(chosen.size());
  for (const std::uint32_t i : balls.SpatialOrder()) ordered.push_back(chosen[i]);
  return ordered;
}

#define STELLATE_INSTANTIATE(K)                                                                    \
  template std::vector<Target<K>> SelectIndependent(const StarComplex<K>&, std::vector<Target<K>>, \
                                                    std::size_t);
STELLATE_INSTANTIATE(1)
STELLATE_INSTANTIATE(2)
STELLATE_INSTANTIATE(3)
STELLATE_INSTANTIATE(4)
STELLATE_INSTANTIATE(5)
#undef STELLATE_INSTANTIATE

}  // namespace stellate::core
