#include "tests/truth/curves.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace stellate::truth {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kTurn = 2 * std::numbers::pi;
constexpr int kSamplesATerm = 160;
constexpr int kReachSamples = 500;

// |q - p|^2 / (2 dist(q, T_p)).
double Quotient(const VectorXd& p, const VectorXd& tangent, const VectorXd& q) {
  const VectorXd step = q - p;
  const double away = (step - tangent * tangent.dot(step)).norm();
  return away > 1e-9 ? step.squaredNorm() / (2 * away) : kInfinity;
}

}  // namespace

Curve::Curve(MatrixXd cosines, MatrixXd sines)
    : cosines_(std::move(cosines)), sines_(std::move(sines)) {
  const int count = kSamplesATerm * static_cast<int>(cosines_.cols());
  samples_.resize(d(), count);
  for (int i = 0; i < count; ++i) samples_.col(i) = At(kTurn * i / count);
}

VectorXd Curve::Derivative(double t, int order) const {
  VectorXd x = VectorXd::Zero(d());
  for (Eigen::Index j = 0; j < cosines_.cols(); ++j) {
    const double frequency = static_cast<double>(j);
    const double scale = order == 0 ? 1.0 : std::pow(frequency, order);
    const double phase = frequency * t + order * std::numbers::pi / 2;
    x += scale * (std::cos(phase) * cosines_.col(j) + std::sin(phase) * sines_.col(j));
  }
  return x;
}

double Curve::Nearest(const VectorXd& x, double* squared) const {
  Eigen::Index best = 0;
  (samples_.colwise() - x).colwise().squaredNorm().minCoeff(&best);
  const double step = kTurn / static_cast<double>(samples_.cols());
  double low = step * static_cast<double>(best - 1), high = step * static_cast<double>(best + 1);
  double t = step * static_cast<double>(best);
  // A zero of the derivative of |x(t) - x|^2 / 2, by Newton steps that stay where it changes sign.
  for (int i = 0; i < 60; ++i) {
    const VectorXd away = At(t) - x, first = Derivative(t, 1);
    const double slope = away.dot(first);
    const double bend = first.squaredNorm() + away.dot(Derivative(t, 2));
    (slope > 0 ? high : low) = t;
    double next = t - slope / bend;
    if (!(next > low && next < high)) next = (low + high) / 2;
    if (std::abs(next - t) < 1e-16 * (1 + std::abs(t))) break;
    t = next;
  }
  *squared = (At(t) - x).squaredNorm();
  return t;
}

Curve Curve::Mirrored() const {
  MatrixXd cosines = cosines_, sines = sines_;
  cosines.row(0) *= -1;
  sines.row(0) *= -1;
  return {cosines, sines};
}

Curve StarShaped(double x, double y, const std::vector<double>& radial) {
  const auto terms = static_cast<Eigen::Index>(radial.size());
  MatrixXd cosines = MatrixXd::Zero(2, terms + 1), sines = cosines;
  cosines.col(0) << x, y;
  // cos(j t) cos t and cos(j t) sin t as sums of single waves.
  for (Eigen::Index j = 0; j < terms; ++j) {
    const double half = radial[static_cast<std::size_t>(j)] / 2;
    cosines(0, j + 1) += half;
    cosines(0, std::abs(j - 1)) += half;
    sines(1, j + 1) += half;
    if (j > 0) sines(1, j - 1) -= half;
    if (j == 0) sines(1, 1) += half;
  }
  return {cosines, sines};
}

Curve Circle(double x, double y, double radius) { return StarShaped(x, y, {radius}); }

Curve TorusCurve(int p, int q, double tube, double turn) {
  MatrixXd cosines = MatrixXd::Zero(3, p + q + 1), sines = cosines;
  // (1 + tube cos(q t + turn)) (cos p t, sin p t), tube sin(q t + turn).
  const double c = tube * std::cos(turn), s = tube * std::sin(turn);
  cosines(0, p) += 1;
  sines(1, p) += 1;
  cosines(0, p + q) += c / 2;
  sines(0, p + q) -= s / 2;
  sines(1, p + q) += c / 2;
  cosines(1, p + q) += s / 2;
  const int apart = std::abs(q - p);
  const double sign = q >= p ? 1 : -1;
  cosines(0, apart) += c / 2;
  sines(0, apart) -= sign * s / 2;
  sines(1, apart) -= sign * c / 2;
  cosines(1, apart) -= s / 2;
  sines(2, q) += c;
  cosines(2, q) += s;
  return {cosines, sines};
}

// Found on samples first, then by ever smaller steps from where each sample sees the least.
double ReachOf(const std::vector<Curve>& curves) {
  constexpr double kSpacing = kTurn / kReachSamples;
  const auto count = curves.size() * kReachSamples;
  std::vector<VectorXd> points, tangents;
  for (const Curve& curve : curves) {
    for (int i = 0; i < kReachSamples; ++i) {
      points.push_back(curve.At(kSpacing * i));
      tangents.push_back(curve.Tangent(kSpacing * i));
    }
  }
  struct Pair {
    double reach = kInfinity;
    std::size_t p = 0, q = 0;
  };
  std::vector<Pair> pairs(count);
  for (std::size_t p = 0; p < count; ++p) {
    for (std::size_t q = 0; q < count; ++q) {
      const double reach = Quotient(points[p], tangents[p], points[q]);
      if (reach < pairs[p].reach) pairs[p] = {reach, p, q};
    }
  }
  std::sort(pairs.begin(), pairs.end(),
            [](const Pair& a, const Pair& b) { return a.reach < b.reach; });
  pairs.resize(std::min<std::size_t>(pairs.size(), 20));
  double least = kInfinity;
  for (Pair& pair : pairs) {
    const Curve& p = curves[pair.p / kReachSamples];
    const Curve& q = curves[pair.q / kReachSamples];
    double s = kSpacing * static_cast<double>(pair.p % kReachSamples);
    double t = kSpacing * static_cast<double>(pair.q % kReachSamples);
    for (double step = kSpacing; step > 1e-4 * kSpacing;) {
      const double before = pair.reach;
      for (const auto& [ds, dt] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}}) {
        const double reach =
            Quotient(p.At(s + ds * step), p.Tangent(s + ds * step), q.At(t + dt * step));
        if (reach >= pair.reach) continue;
        pair.reach = reach;
        s += ds * step;
        t += dt * step;
      }
      if (pair.reach == before) step /= 2;
    }
    least = std::min(least, pair.reach);
  }
  return least;
}

double RadiusOf(const std::vector<Curve>& curves) {
  double most = 0;
  for (const Curve& c : curves) most = std::max(most, c.samples().colwise().norm().maxCoeff());
  return 1.05 * most;
}

const Curve* NearestOf(const std::vector<Curve>& curves, const VectorXd& x, double* t) {
  const Curve* best = nullptr;
  double least = kInfinity, squared = 0;
  for (const Curve& curve : curves) {
    const double at = curve.Nearest(x, &squared);
    if (squared >= least) continue;
    least = squared;
    best = &curve;
    *t = at;
  }
  return best;
}

}  // namespace stellate::truth
