// GUDHI prints to std::cerr without including it.
// clang-format off
#include <iostream>
#include <gudhi/Tangential_complex.h>
#include <gudhi/sparsify_point_set.h>
// clang-format on

#include <CGAL/Epick_d.h>

#include <array>
#include <cmath>
#include <iterator>
#include <random>
#include <stdexcept>

#include "tests/bench/peers/peer.h"
#include "tests/support/make_manifold.h"

namespace stellate::bench {
namespace {

constexpr int kOversampling = 20;  // random points for each that is kept
constexpr double kCloseEnough = 0.01;
constexpr int kMaxTries = 12;
// Largest move of a point in the repair, as a share of the spacing. Of 0.01 to 0.5 this closed
// SO(3), the hardest case, in the least time; elsewhere it hardly matters.
constexpr double kPerturbation = 0.06;

// About uniform random points of the manifold: exactly so on spheres and on the rotations.
Eigen::MatrixXd RandomPoints(Manifold& manifold, Eigen::Index count) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const auto box = manifold.bounding_box();
  if (!box) throw std::runtime_error("no bounding box");
  const Eigen::VectorXd centre = (box->lower + box->upper) / 2;
  const double scale = (box->upper - box->lower).norm() / 2;
  return manifold
      .ClosestPoint((scale * Eigen::MatrixXd::NullaryExpr(manifold.ambient_dimension(), count,
                                                          [&] { return normal(random); }))
                        .colwise() +
                    centre)
      .points;
}

// A sample of about `size` points of even spacing, for Tangential_complex is not one to choose its
// own. Sets the spacing.
template <typename Kernel>
std::vector<typename Kernel::Point_d> EvenSample(Manifold& manifold, double size, double* spacing) {
  using Point = typename Kernel::Point_d;
  const Eigen::Index d = manifold.ambient_dimension();
  const Eigen::MatrixXd dense =
      RandomPoints(manifold, static_cast<Eigen::Index>(kOversampling * size));
  std::vector<Point> candidates;
  for (Eigen::Index j = 0; j < dense.cols(); ++j) {
    candidates.emplace_back(static_cast<int>(d), dense.col(j).data(), dense.col(j).data() + d);
  }
  std::vector<Point> sample;
  *spacing = std::pow(size, -1.0 / manifold.dimension());
  for (int i = 0; i < kMaxTries; ++i) {
    sample.clear();
    Gudhi::subsampling::sparsify_point_set(Kernel(), candidates, *spacing * *spacing,
                                           std::back_inserter(sample));
    const double ratio = static_cast<double>(sample.size()) / size;
    if (std::abs(ratio - 1) < kCloseEnough) break;
    *spacing *= std::pow(ratio, 1.0 / manifold.dimension());
  }
  return sample;
}

template <int D, int K>
Outcome Run(Manifold& manifold, const Task& task, Meter& meter) {
  using Kernel = CGAL::Epick_d<CGAL::Dimension_tag<D>>;
  using Complex = Gudhi::tangential_complex::Tangential_complex<Kernel, CGAL::Dimension_tag<K>,
                                                                CGAL::Sequential_tag>;
  double spacing = 0;
  const auto sample = EvenSample<Kernel>(manifold, task.size, &spacing);
  const auto n = static_cast<Eigen::Index>(sample.size());
  Outcome outcome;
  outcome.points.resize(D, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    for (int i = 0; i < D; ++i) outcome.points(i, j) = sample[static_cast<std::size_t>(j)][i];
  }
  typename Complex::TS_container tangents;
  const Eigen::MatrixXd bases = manifold.TangentBasis(outcome.points);
  for (Eigen::Index j = 0; j < n; ++j) {
    typename Complex::Tangent_space_basis tangent(static_cast<std::size_t>(j));
    for (int a = 0; a < K; ++a) {
      std::array<double, D> direction;
      for (int i = 0; i < D; ++i) direction[static_cast<std::size_t>(i)] = bases(i * K + a, j);
      tangent.push_back(typename Kernel::Vector_d(D, direction.begin(), direction.end()));
    }
    tangents.push_back(tangent);
  }

  meter.Start();
  Complex complex(sample, K);
  if (!task.estimate_tangents) complex.set_tangent_planes(tangents);
  complex.compute_tangential_complex();
  const auto repair = complex.fix_inconsistencies_using_perturbation(
      kPerturbation * spacing, task.time_limit > 0 ? task.time_limit : -1);
  meter.Stop();

  typename Complex::Simplicial_complex simplices;
  // 0: do not look for simplices of other dimensions, which takes quadratic time.
  complex.create_complex(simplices, true, false, 0);
  for (const auto& simplex : simplices.simplex_range()) {
    if (simplex.size() != K + 1) continue;
    for (const std::size_t vertex : simplex) {
      outcome.simplices.push_back(static_cast<std::uint32_t>(vertex));
    }
  }
  outcome.evaluations = sample.size();
  outcome.note = std::to_string(repair.initial_num_inconsistent_stars) +
                 " inconsistent stars at first, " +
                 std::to_string(repair.final_num_inconsistent_stars) + " after " +
                 std::to_string(repair.num_steps) + " steps of repair";
  return outcome;
}

}  // namespace

Outcome MeshWithGudhiTangential(const Task& task, Meter& meter) {
  const std::unique_ptr<Manifold> manifold = testing::Make(task.manifold);
  const int d = manifold->ambient_dimension(), k = manifold->dimension();
  if (d == 4 && k == 2) return Run<4, 2>(*manifold, task, meter);
  if (d == 4 && k == 3) return Run<4, 3>(*manifold, task, meter);
  if (d == 9 && k == 3) return Run<9, 3>(*manifold, task, meter);
  throw std::runtime_error("not built for the dimensions of " + task.manifold);
}

}  // namespace stellate::bench
