// GUDHI prints to std::cerr without including it.
// clang-format off
#include <iostream>
#include <gudhi/Tangential_complex.h>
// clang-format on

#include <CGAL/Epick_d.h>

#include <vector>

#include "tests/bench/clouds/reconstruct.h"
#include "tests/bench/peers/meter.h"

namespace stellate::bench {
namespace {

constexpr double kPerturbation = 0.06;  // in spacings: see tests/bench/peers/gudhi_tangential.cc
constexpr double kRepairSeconds = 20;

template <int D, int K>
Reconstructed Run(const testing::Sample& sample) {
  using Kernel = CGAL::Epick_d<CGAL::Dimension_tag<D>>;
  using Complex = Gudhi::tangential_complex::Tangential_complex<Kernel, CGAL::Dimension_tag<K>,
                                                                CGAL::Sequential_tag>;
  std::vector<typename Kernel::Point_d> points;
  for (Eigen::Index j = 0; j < sample.points.cols(); ++j)
    points.emplace_back(D, sample.points.col(j).data(), sample.points.col(j).data() + D);
  Reconstructed made;
  made.vertices = static_cast<std::uint32_t>(points.size());
  const double before = ProcessorSeconds();
  Complex complex(points, K);
  complex.compute_tangential_complex();
  complex.fix_inconsistencies_using_perturbation(kPerturbation * sample.Spacing(), kRepairSeconds);
  made.seconds = ProcessorSeconds() - before;
  typename Complex::Simplicial_complex simplices;
  // 0: do not look for simplices of other dimensions, which takes quadratic time.
  complex.create_complex(simplices, true, false, 0);
  for (const auto& simplex : simplices.simplex_range()) {
    if (simplex.size() != K + 1) continue;
    for (const std::size_t vertex : simplex)
      made.simplices.push_back(static_cast<std::uint32_t>(vertex));
  }
  return made;
}

}  // namespace

Reconstructed ReconstructWithTangential(const testing::Sample& sample) {
  const int k = sample.k, d = sample.d;
  if (k == 2 && d == 3) return Run<3, 2>(sample);
  if (k == 2 && d == 4) return Run<4, 2>(sample);
  if (k == 3 && d == 4) return Run<4, 3>(sample);
  if (k == 3 && d == 6) return Run<6, 3>(sample);
  if (k == 3 && d == 9) return Run<9, 3>(sample);
  Reconstructed none;
  none.applies = false;
  return none;
}

}  // namespace stellate::bench
