#include "tests/reconstruction/samples.h"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <random>
#include <stdexcept>
#include <utility>

#include "core/index/indexed_points.h"

namespace stellate::testing {
namespace {

constexpr double kPi = std::numbers::pi;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A manifold as the image of a box by a chart, k coordinates in [0, 2 pi), with the density of its
// volume there, or as what draws its points.
struct Known {
  int k, d;
  double reach;
  std::vector<int> betti;  // mod 2
  bool orientable;
  double volume;
  std::function<VectorXd(const VectorXd&)> chart;  // none: a sphere or SO(3)
  double most_area = 1;
};

VectorXd Knot(const VectorXd& c) {
  const double r = 1 + .4 * std::cos(3 * c[0]);
  return Eigen::Vector3d(r * std::cos(2 * c[0]), r * std::sin(2 * c[0]), .4 * std::sin(3 * c[0]));
}
VectorXd Torus(const VectorXd& c) {
  const double r = 1 + .4 * std::cos(c[1]);
  return Eigen::Vector3d(r * std::cos(c[0]), r * std::sin(c[0]), .4 * std::sin(c[1]));
}
VectorXd Klein(const VectorXd& c) {
  const double r = 1 + .4 * std::cos(c[1]), s = .4 * std::sin(c[1]);
  return Eigen::Vector4d(r * std::cos(c[0]), r * std::sin(c[0]), s * std::cos(c[0] / 2),
                         s * std::sin(c[0] / 2));
}
VectorXd FlatTorus(const VectorXd& c) {
  VectorXd x(2 * c.size());
  for (Index a = 0; a < c.size(); ++a) {
    x[2 * a] = std::cos(c[a]);
    x[2 * a + 1] = std::sin(c[a]);
  }
  return x;
}

// Vectors along the chart's axes.
MatrixXd Slopes(const Known& m, const VectorXd& c) {
  constexpr double kStep = 1e-5;
  MatrixXd slopes(m.d, m.k);
  for (int a = 0; a < m.k; ++a) {
    VectorXd up = c, down = c;
    up[a] += kStep;
    down[a] -= kStep;
    slopes.col(a) = (m.chart(up) - m.chart(down)) / (2 * kStep);
  }
  return slopes;
}
double Area(const MatrixXd& slopes) {
  return std::sqrt((slopes.transpose() * slopes).determinant());
}

// Of curves and surfaces whose volume has no formula, by a sum that converges as fast as one can.
double VolumeBySum(const Known& m) {
  constexpr int kSteps = 2000;
  double sum = 0;
  VectorXd c = VectorXd::Constant(m.k, .1);
  for (int i = 0; i < kSteps; ++i) {
    c[m.k - 1] = 2 * kPi * i / kSteps;
    sum += Area(Slopes(m, c)) * 2 * kPi / kSteps;
  }
  return m.k == 1 ? sum : 0;
}

Known Find(const std::string& name) {
  if (name == "circle") return {1, 2, 1, {1, 1}, true, 2 * kPi, FlatTorus, 1};
  if (name == "knot") {
    Known knot{1, 3, .45, {1, 1}, true, 0, Knot, 3.1};
    knot.volume = VolumeBySum(knot);
    return knot;
  }
  if (name == "s2" || name == "shells") return {2, 3, 1, {1, 0, 1}, true, 4 * kPi, nullptr, 1};
  if (name == "torus") return {2, 3, .4, {1, 2, 1}, true, 1.6 * kPi * kPi, Torus, .56};
  if (name == "half") return {2, 3, .4, {1, 2, 1}, true, .8 * kPi * kPi, Torus, .56};
  if (name == "t2") return {2, 4, 1, {1, 2, 1}, true, 4 * kPi * kPi, FlatTorus, 1};
  if (name == "klein") return {2, 4, .4, {1, 2, 1}, false, 1.62 * kPi * kPi, Klein, .58};
  if (name == "s3") return {3, 4, 1, {1, 0, 0, 1}, true, 2 * kPi * kPi, nullptr, 1};
  if (name == "so3")
    return {3, 9, std::sqrt(2.0), {1, 1, 1, 1}, true, 8 * kPi * kPi * std::sqrt(8.0), nullptr, 1};
  if (name == "t3") return {3, 6, 1, {1, 3, 3, 1}, true, 8 * kPi * kPi * kPi, FlatTorus, 1};
  throw std::invalid_argument("no manifold " + name);
}

class Drawer {
 public:
  explicit Drawer(const SampleRequest& request)
      : request_(request), known_(Find(request.manifold)), rng_(request.seed) {}

  // One point of the manifold, uniform, and a tangent basis, d x k.
  std::pair<VectorXd, MatrixXd> Next() {
    if (request_.manifold == "so3") return NextRotation();
    if (!known_.chart) return NextOnSphere();
    for (;;) {
      VectorXd c(known_.k);
      for (Index a = 0; a < c.size(); ++a) c[a] = 2 * kPi * Uniform();
      const MatrixXd slopes = Slopes(known_, c);
      if (Uniform() * known_.most_area > Area(slopes)) continue;
      const VectorXd x = known_.chart(c);
      if (request_.manifold == "half" && x[0] < 0) continue;
      return {x, Basis(slopes)};
    }
  }
  double Uniform() { return std::uniform_real_distribution<double>()(rng_); }
  double Normal() { return std::normal_distribution<double>()(rng_); }
  const Known& known() const { return known_; }

 private:
  static MatrixXd Basis(const MatrixXd& columns) {
    return Eigen::HouseholderQR<MatrixXd>(columns).householderQ() *
           MatrixXd::Identity(columns.rows(), columns.cols());
  }
  std::pair<VectorXd, MatrixXd> NextOnSphere() {
    MatrixXd columns(known_.d, known_.d);
    for (double& x : columns.reshaped()) x = Normal();
    const MatrixXd basis = Basis(columns);
    return {columns.col(0).normalized(), basis.rightCols(known_.k)};
  }
  std::pair<VectorXd, MatrixXd> NextRotation() {
    Eigen::Vector4d v;
    for (double& x : v) x = Normal();
    v.normalize();
    const double a = v[0], b = v[1], c = v[2], e = v[3];
    Eigen::Matrix3d r;
    r << a * a + b * b - c * c - e * e, 2 * (b * c - a * e), 2 * (b * e + a * c),
        2 * (b * c + a * e), a * a - b * b + c * c - e * e, 2 * (c * e - a * b),
        2 * (b * e - a * c), 2 * (c * e + a * b), a * a - b * b - c * c + e * e;
    VectorXd x(9);
    MatrixXd tangent(9, 3);
    for (int i = 0; i < 9; ++i) x[i] = r(i / 3, i % 3);
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Matrix3d skew = Eigen::Matrix3d::Zero();
      skew((axis + 1) % 3, (axis + 2) % 3) = 1;
      skew((axis + 2) % 3, (axis + 1) % 3) = -1;
      const Eigen::Matrix3d turned = r * skew / std::sqrt(2.0);
      for (int i = 0; i < 9; ++i) tangent(i, axis) = turned(i / 3, i % 3);
    }
    return {x, tangent};
  }

  const SampleRequest& request_;
  const Known known_;
  std::mt19937_64 rng_;
};

// Keeps points of a large uniform sample, none nearer to an earlier one than `apart`.
void Thin(double apart, std::vector<VectorXd>* points, std::vector<MatrixXd>* tangents) {
  const int d = static_cast<int>(points->front().size());
  core::IndexedPoints kept(d);
  std::vector<VectorXd> x;
  std::vector<MatrixXd> t;
  for (std::size_t i = 0; i < points->size(); ++i) {
    if (kept.size() > 0 && kept.tree().AnyWithin((*points)[i].data(), apart)) continue;
    kept.Add((*points)[i].data());
    x.push_back((*points)[i]);
    t.push_back((*tangents)[i]);
  }
  *points = std::move(x);
  *tangents = std::move(t);
}

}  // namespace

double Sample::Spacing() const {
  return std::pow(volume / static_cast<double>(points.cols()), 1.0 / k);
}

Sample Draw(const SampleRequest& request) {
  Drawer drawer(request);
  const Known& known = drawer.known();
  Sample sample;
  sample.k = known.k;
  sample.d = known.d;
  sample.volume = known.volume;
  sample.reach = known.reach;
  sample.betti = known.betti;
  sample.orientable = known.orientable;
  std::vector<VectorXd> points;
  std::vector<MatrixXd> tangents;
  const double share = known.k == 1 ? .72 : known.k == 2 ? .76 : .80;
  const double spacing = std::pow(known.volume / request.points, 1.0 / known.k);
  const std::uint32_t pool = request.points * (request.even ? 15 : 1);
  for (std::uint32_t i = 0; i < pool; ++i) {
    auto [x, t] = drawer.Next();
    points.push_back(std::move(x));
    tangents.push_back(std::move(t));
  }
  if (request.even) Thin(share * spacing, &points, &tangents);
  if (request.manifold == "shells") {  // each point of the sphere again, farther out
    const double out = 1 + request.gap * spacing;
    const std::size_t inner = points.size();
    for (std::size_t i = 0; i < inner; ++i) {
      auto [x, t] = drawer.Next();
      points.push_back(out * x);
      tangents.push_back(t);
    }
    if (request.even) {
      std::vector<VectorXd> outer(points.begin() + static_cast<std::ptrdiff_t>(inner),
                                  points.end());
      std::vector<MatrixXd> bases(tangents.begin() + static_cast<std::ptrdiff_t>(inner),
                                  tangents.end());
      Thin(share * spacing, &outer, &bases);
      points.resize(inner);
      tangents.resize(inner);
      points.insert(points.end(), outer.begin(), outer.end());
      tangents.insert(tangents.end(), bases.begin(), bases.end());
    }
    sample.components = 2;
    sample.betti = {2, 0, 2};
    sample.volume *= 1 + out * out;
    sample.reach = (out - 1) / 2;
  }
  for (std::size_t i = 0; i < sample.betti.size(); ++i)
    sample.euler += i % 2 == 0 ? sample.betti[i] : -sample.betti[i];
  const VectorXd centre = points.front();
  std::vector<Index> keep;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (request.hole == 0 || (points[i] - centre).norm() > request.hole * spacing)
      keep.push_back(static_cast<Index>(i));
  const auto n = static_cast<Index>(keep.size());
  sample.points.resize(known.d, n);
  sample.tangents.resize(Index{known.d} * known.k, n);
  for (Index i = 0; i < n; ++i) {
    const auto from = static_cast<std::size_t>(keep[static_cast<std::size_t>(i)]);
    sample.points.col(i) = points[from];
    sample.tangents.col(i) = tangents[from].transpose().reshaped();
  }
  const double deviation = request.noise * sample.Spacing();
  if (deviation > 0)
    for (double& x : sample.points.reshaped()) x += deviation * drawer.Normal();
  const auto outliers = static_cast<Index>(request.outliers * static_cast<double>(n));
  const VectorXd low = sample.points.rowwise().minCoeff(),
                 high = sample.points.rowwise().maxCoeff();
  for (Index i = 0; i < outliers; ++i)
    for (Index c = 0; c < known.d; ++c)
      sample.points(c, i * (n / std::max<Index>(1, outliers))) =
          low[c] + (high[c] - low[c]) * drawer.Uniform();
  return sample;
}

std::vector<NamedRequest> GoodSamples() {
  std::vector<NamedRequest> samples;
  const auto add = [&](const char* manifold, std::uint32_t points, double noise) {
    for (const bool even : {true, false}) {
      SampleRequest request;
      request.manifold = manifold;
      request.points = points;
      request.even = even;
      request.noise = noise;
      char name[80];
      std::snprintf(name, sizeof(name), "%s %s, noise %g", manifold, even ? "even" : "uniform",
                    noise);
      samples.push_back({name, request});
    }
  };
  for (const double noise : {0.0, .1, .2, .4}) {
    add("circle", 200, noise);
    add("knot", 400, noise);
    for (const char* manifold : {"s2", "torus", "t2", "klein"}) add(manifold, 1500, noise);
  }
  for (const double noise : {0.0, .1, .2}) {
    add("s3", 2000, noise);
    add("so3", 2500, noise);
    add("t3", 6000, noise);
  }
  return samples;
}

}  // namespace stellate::testing
