#include "core/refinement/independent_set.h"

#include <algorithm>

#include "core/sample/ball_tree.h"

namespace stellate::core {

template <int K>
std::vector<Target<K>> SelectIndependent(const StarComplex<K>& complex,
                                         std::vector<Target<K>> targets) {
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
    complex.Lift(t.star, t.x, centre.data());
    bool conflict = false;
    balls.ForEachInfluencing(centre.data(), [&](std::uint32_t) { conflict = true; });
    if (conflict) continue;
    centres.insert(centres.end(), centre.begin(), centre.end());
    balls.Insert(t.violation.rule >= Rule::kSliver ? 2 * t.radius : t.radius);
    chosen.push_back(t);
  }
  return chosen;
}

template std::vector<Target<1>> SelectIndependent(const StarComplex<1>&, std::vector<Target<1>>);
template std::vector<Target<2>> SelectIndependent(const StarComplex<2>&, std::vector<Target<2>>);
template std::vector<Target<3>> SelectIndependent(const StarComplex<3>&, std::vector<Target<3>>);
template std::vector<Target<4>> SelectIndependent(const StarComplex<4>&, std::vector<Target<4>>);
template std::vector<Target<5>> SelectIndependent(const StarComplex<5>&, std::vector<Target<5>>);

}  // namespace stellate::core
