#include "oracles/ready/atlas.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "oracles/combined/common.h"

namespace stellate::oracles {
namespace {

constexpr int kSamples = 20'000;    // of all charts together, to begin from
constexpr int kNearest = 8;         // of them looked at for each query
constexpr size_t kBasins = 3;       // the most of these that begin a search
constexpr double kSameBasin = 3.5;  // cells of the grid
constexpr size_t kEnds = 16;        // samples at a period's ends that are compared
constexpr double kSeam = 1e-4;      // of M's size: a gap there that no solver's error explains
constexpr int kMaxIterations = 100, kMaxHalvings = 30, kMaxFlatHalvings = 20;

// Lengths in shares of M's size.
constexpr double kArrived = 1e-11;  // a step along M
constexpr double kLongest = 0.1;    // of one step
constexpr double kUndecided =
    1e-5;  // so short a step that distances may not tell better from worse
constexpr double kUndecidedBy = 1e-12;               // then
constexpr double kMet = 1e-13, kMetAtLeast = 1e-11;  // a flat; where no step comes nearer
constexpr double kLeastBend = 0.05;  // of the distance, whose own is 1 where M is flat
constexpr double kRegular = 1e-9;    // least pivot of a derivative, in shares of the largest

// Whether a point is as near to some columns, samples of a face, as these to each other: a
// parameter comes round turned over, as a Klein bottle's does.
bool LiesAlong(const Eigen::MatrixXd& points, const std::vector<Eigen::Index>& face,
               const Eigen::VectorXd& point) {
  if (face.size() < 3) return false;
  const Eigen::MatrixXd at = points(Eigen::all, face);
  double apart = 0;  // squared
  for (Eigen::Index i = 0; i < at.cols(); ++i) {
    Eigen::VectorXd others = (at.colwise() - at.col(i)).colwise().squaredNorm();
    others[i] = std::numeric_limits<double>::infinity();
    apart = std::max(apart, others.minCoeff());
  }
  return (at.colwise() - point).colwise().squaredNorm().minCoeff() <= 4 * apart;
}

}  // namespace

Parametrized::Atlas::Atlas(std::vector<Chart> charts) {
  if (charts.empty()) Refuse("Parametrized needs one chart at least");
  for (size_t i = 0; i < charts.size(); ++i) charts_.emplace_back(std::move(charts[i]), i);
  for (size_t i = 0; i < charts_.size(); ++i) {
    if (charts_[i].k() != charts_[0].k()) {
      Refuse("chart " + std::to_string(i) + " has " + std::to_string(charts_[i].k()) +
             " parameters, chart 0 " + std::to_string(charts_[0].k()));
    }
  }
  Sample();
  if (dimension() >= ambient_dimension()) {
    Refuse("charts of R^" + std::to_string(dimension()) + " into R^" +
           std::to_string(ambient_dimension()) + ": the first has to be the smaller");
  }
  scale_ = (points().rowwise().maxCoeff() - points().rowwise().minCoeff()).norm();
  InsistOnComingRound();  // first: what turns many times looks inexact
  for (const CheckedChart& chart : charts_) chart.InsistOnExactness();
}

// Refuses a periodic parameter at whose ends the map is at two places, as of degrees for radians.
void Parametrized::Atlas::InsistOnComingRound() const {
  for (size_t number = 0; number < charts_.size(); ++number) {
    const CheckedChart& chart = charts_[number];
    for (Eigen::Index a = 0; a < chart.k(); ++a) {
      if (!chart.wraps(a)) continue;
      std::vector<Eigen::Index> starts;
      for (Eigen::Index j = 0; j < grid_.cols(); ++j) {
        const bool mine = owner_[static_cast<size_t>(j)] == number;
        if (mine && grid_(a, j) == chart.lower()[a]) starts.push_back(j);
      }
      const size_t step = std::max<size_t>(1, starts.size() / kEnds);
      for (size_t i = 0; i < starts.size(); i += step) {
        Eigen::VectorXd end = grid_.col(starts[i]);
        end[a] = chart.upper()[a];
        const double gap = (chart.Point(end) - points().col(starts[i])).norm();
        if (gap <= kSeam * scale_ || LiesAlong(points(), starts, chart.Point(end))) continue;
        Refuse((charts_.size() == 1 ? "the map" : "chart " + std::to_string(number)) +
               " does not come round as periodic says: from the lower end " +
               Short(chart.lower()[a]) + " of parameter " + std::to_string(a) + " to the upper " +
               Short(chart.upper()[a]) + " it goes " + Short(gap) +
               " away. Give a whole period, in the unit that the map takes (std::cos takes "
               "radians), or leave periodic out");
      }
    }
  }
}

// A grid of parameters on each chart, and where it lies in R^d.
void Parametrized::Atlas::Sample() {
  const Eigen::Index k = charts_[0].k();
  const double share = kSamples / static_cast<double>(charts_.size());
  per_side_ = std::max(4, static_cast<int>(std::pow(share, 1.0 / static_cast<double>(k))));
  Eigen::Index per_chart = 1;
  for (Eigen::Index a = 0; a < k; ++a) per_chart *= per_side_;
  grid_.resize(k, per_chart * std::ssize(charts_));
  Eigen::MatrixXd points;
  for (Eigen::Index j = 0; j < grid_.cols(); ++j) {
    owner_.push_back(static_cast<size_t>(j / per_chart));
    const CheckedChart& chart = charts_[owner_.back()];
    Eigen::Index rest = j % per_chart;
    for (Eigen::Index a = k - 1; a >= 0; --a, rest /= per_side_) {
      const int cells = per_side_ - (chart.wraps(a) ? 0 : 1);
      grid_(a, j) =
          chart.lower()[a] + static_cast<double>(rest % per_side_) / cells * chart.extent()[a];
    }
    const Eigen::VectorXd point = chart.Point(grid_.col(j));
    if (j == 0) points.resize(point.size(), grid_.cols());
    if (point.size() != points.rows()) {
      Refuse("charts lead to R^" + std::to_string(points.rows()) + " and to R^" +
             std::to_string(point.size()));
    }
    points.col(j) = point;
  }
  CheckPoints(points, "the charts' points");
  tree_ = std::make_unique<const PointTree>(std::move(points));
}

// To begin from: the nearest sample, and others near that belong to another chart or lie more than
// three cells of the grid away.
std::vector<Parametrized::Atlas::Beginning> Parametrized::Atlas::Beginnings(
    const Eigen::VectorXd& x) const {
  std::vector<Eigen::Index> taken;
  for (const Eigen::Index sample : tree_->Nearest(x, kNearest)) {
    const bool fresh = std::all_of(taken.begin(), taken.end(),
                                   [&](Eigen::Index earlier) { return Apart(sample, earlier); });
    if (fresh) taken.push_back(sample);
  }
  if (taken.size() > kBasins) taken.resize(kBasins);
  std::vector<Beginning> beginnings;
  beginnings.reserve(taken.size());
  for (const Eigen::Index sample : taken) {
    beginnings.push_back({&charts_[owner_[static_cast<size_t>(sample)]], grid_.col(sample)});
  }
  return beginnings;
}

bool Parametrized::Atlas::Apart(Eigen::Index a, Eigen::Index b) const {
  const size_t owner = owner_[static_cast<size_t>(a)];
  if (owner != owner_[static_cast<size_t>(b)]) return true;
  const CheckedChart& chart = charts_[owner];
  double farthest = 0;
  for (Eigen::Index i = 0; i < chart.k(); ++i) {
    double gap = std::abs(grid_(i, a) - grid_(i, b)) / chart.extent()[i];
    if (chart.wraps(i)) gap = std::min(gap, 1 - gap);
    farthest = std::max(farthest, gap);
  }
  return farthest > kSameBasin / per_side_;
}

bool Parametrized::Atlas::Closest(const Eigen::VectorXd& x, Eigen::VectorXd& y,
                                  Eigen::MatrixXd& basis) const {
  bool found = false;
  Eigen::VectorXd there;
  Eigen::MatrixXd there_basis;
  for (const Beginning& from : Beginnings(x)) {
    if (!Descend(from, x, there, there_basis)) continue;
    if (found && (there - x).norm() >= (y - x).norm()) continue;
    y = there;
    basis = there_basis;
    found = true;
  }
  return found;
}

// Newton's method on the distance to x as a function on M, in an orthonormal frame of the tangent
// space, so that it does not matter how fast a parameter goes; steps are halved until they lead
// nearer. Where the distance bends the wrong way the step goes downhill all the same.
bool Parametrized::Atlas::Descend(const Beginning& from, const Eigen::VectorXd& x,
                                  Eigen::VectorXd& y, Eigen::MatrixXd& basis) const {
  const CheckedChart& chart = *from.chart;
  const Eigen::Index k = chart.k();
  Eigen::VectorXd u = chart.Inside(from.u);
  y = chart.Point(u);
  for (int i = 0; i < kMaxIterations; ++i) {
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(chart.Slopes(u));
    const Eigen::MatrixXd triangle = qr.matrixQR().topRows(k).triangularView<Eigen::Upper>();
    const Eigen::VectorXd pivots = triangle.diagonal().cwiseAbs();
    if (!(pivots.minCoeff() > kRegular * std::max(pivots.maxCoeff(), 1e-300))) return false;
    basis = qr.householderQ() * Eigen::MatrixXd::Identity(x.size(), k);
    const Eigen::MatrixXd inverse =
        triangle.triangularView<Eigen::Upper>().solve(Eigen::MatrixXd::Identity(k, k));
    const Eigen::MatrixXd hessian =
        Eigen::MatrixXd::Identity(k, k) + inverse.transpose() * chart.Bend(u, y - x) * inverse;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes((hessian + hessian.transpose()) / 2);
    const Eigen::VectorXd shares =
        (axes.eigenvectors().transpose() * (basis.transpose() * (x - y))).array() /
        axes.eigenvalues().array().abs().max(kLeastBend);
    Eigen::VectorXd v = axes.eigenvectors() * shares;
    const double length = v.norm();
    if (length <= kArrived * scale_) return true;
    v *= std::min(1.0, kLongest * scale_ / length);
    Eigen::VectorXd step = inverse * v;
    const double slack = length <= kUndecided * scale_ ? kUndecidedBy * scale_ : 0;
    bool moved = false;
    for (int half = 0; half < kMaxHalvings && !moved; ++half, step /= 2) {
      const Eigen::VectorXd there = chart.Inside(u + step);
      const Eigen::VectorXd point = chart.Point(there);
      const double before = (y - x).norm(), after = (point - x).norm();
      moved = (after < before || (slack > 0 && after <= before + slack)) && there != u;
      if (!moved) continue;
      u = there;
      y = point;
    }
    if (!moved) return false;
  }
  return false;
}

bool Parametrized::Atlas::Meet(const Eigen::VectorXd& center, const Eigen::MatrixXd& basis,
                               double radius, Eigen::VectorXd& y) const {
  bool found = false;
  Eigen::VectorXd there;
  for (const Beginning& from : Beginnings(center)) {
    if (!MeetFrom(from, center, basis, there)) continue;
    const double away = (there - center).norm();
    if (away > radius || (found && away >= (y - center).norm())) continue;
    y = there;
    found = true;
  }
  return found;
}

// Newton's method, with steps halved until what is left falls.
bool Parametrized::Atlas::MeetFrom(const Beginning& from, const Eigen::VectorXd& center,
                                   const Eigen::MatrixXd& basis, Eigen::VectorXd& y) const {
  const CheckedChart& chart = *from.chart;
  Eigen::VectorXd u = chart.Inside(from.u);
  y = chart.Point(u);
  for (int i = 0; i < kMaxIterations; ++i) {
    const Eigen::VectorXd off = basis.transpose() * (y - center);
    if (off.norm() <= kMet * scale_) return true;
    const Eigen::PartialPivLU<Eigen::MatrixXd> system(basis.transpose() * chart.Slopes(u));
    Eigen::VectorXd step = -system.solve(off);
    if (!step.allFinite()) return false;
    bool better = false;
    for (int half = 0; half < kMaxFlatHalvings && !better; ++half, step /= 2) {
      const Eigen::VectorXd there = chart.Inside(u + step);
      const Eigen::VectorXd point = chart.Point(there);
      better = (basis.transpose() * (point - center)).norm() < off.norm();
      if (!better) continue;
      u = there;
      y = point;
    }
    // What no step lowers is where rounding has the last word, or a local minimum.
    if (!better) return off.norm() <= kMetAtLeast * scale_;
  }
  return false;
}

std::vector<Chart> Parametrized::Atlas::DividedBy(const Eigen::VectorXd& scale) const {
  std::vector<Chart> divided;
  for (const CheckedChart& chart : charts_) divided.push_back(chart.DividedBy(scale));
  return divided;
}

}  // namespace stellate::oracles
