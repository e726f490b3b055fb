#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "doctor/examination.h"

// Whether the equations that M is given by, if it is, are of full rank on all of it.
namespace stellate::doctor {
namespace {

using Vector = Eigen::VectorXd;
using Eigen::Index, Eigen::MatrixXd;

constexpr int kWays = 2;  // that are tried at a time, each forth and back
constexpr double kBeyond = std::numeric_limits<double>::infinity();

double MedianOf(const Vector& values) {
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  return (sorted[(sorted.size() - 1) / 2] + sorted[sorted.size() / 2]) / 2;
}

// The Jacobian of the equations, each by how steep it is usually, so that units do not matter.
class Jacobians {
 public:
  explicit Jacobians(Probe& probe) : probe_(probe), usual_(Vector::Ones(Count())) {
    const std::vector<MatrixXd> all = At(probe.points);
    for (Index i = 0; i < Count(); ++i) {
      Vector steep(std::ssize(all));
      for (size_t j = 0; j < all.size(); ++j) steep[static_cast<Index>(j)] = all[j].row(i).norm();
      usual_[i] = std::max(MedianOf(steep), 1e-300);
    }
  }

  // The least singular values at points of M; infinite beyond a wall.
  Vector Least(const MatrixXd& points) const {
    Vector least(points.cols());
    const std::vector<MatrixXd> all = At(points);
    for (size_t j = 0; j < all.size(); ++j) {
      least[static_cast<Index>(j)] =
          Eigen::JacobiSVD<MatrixXd>(all[j]).singularValues()[Count() - 1];
    }
    if (probe_.walls() > 0 && points.cols() > 0) {
      const MatrixXd inside = probe_.Clearances(points);
      least = (inside.colwise().minCoeff().array() < 0).transpose().select(kBeyond, least);
    }
    return least;
  }

  std::vector<Basis> Tangents(const MatrixXd& points) const {
    std::vector<Basis> tangents;
    for (const MatrixXd& one : At(points)) {
      const Eigen::JacobiSVD<MatrixXd> svd(one, Eigen::ComputeFullV);
      tangents.emplace_back(svd.matrixV().rightCols(probe_.k()));
    }
    return tangents;
  }

 private:
  Index Count() const { return probe_.d() - probe_.k(); }

  std::vector<MatrixXd> At(const MatrixXd& points) const {
    const MatrixXd gradients = probe_.EquationGradients(points);
    std::vector<MatrixXd> all;
    for (const auto& column : gradients.colwise()) {
      all.emplace_back(usual_.cwiseInverse().asDiagonal() *
                       column.reshaped(probe_.d(), Count()).transpose());
    }
    return all;
  }

  Probe& probe_;
  Vector usual_;
};

// From points of M downhill along it, by shorter and shorter steps in random ways: far below what
// the value is where they begin, if it has a zero near by, for the last steps are that short.
struct Descent {
  MatrixXd places;
  Vector least;

  void Go(Probe& probe, const Jacobians& jacobians) {
    Vector steps = Vector::Constant(places.cols(), kRankFirstStep * probe.size);
    for (int round = 0; round < kRankRounds; ++round) {
      Indices moving;
      for (Index j = 0; j < steps.size(); ++j) {
        if (steps[j] > kRankLastStep * probe.size) moving.push_back(j);
      }
      if (moving.empty()) return;
      const std::vector<Basis> bases = jacobians.Tangents(Take(places, moving));
      std::vector<bool> came(moving.size(), false);
      for (int way = 0; way < kWays; ++way) {
        MatrixXd step = probe.RandomUnits(std::ssize(moving));
        for (size_t a = 0; a < moving.size(); ++a) {
          const auto column = static_cast<Index>(a);
          const Vector along = bases[a] * (bases[a].transpose() * step.col(column));
          step.col(column) = steps[moving[a]] * along.normalized();
        }
        for (const double side : {1.0, -1.0}) {
          TryAll(probe, jacobians, moving, side * step, &came);
        }
      }
      for (size_t a = 0; a < moving.size(); ++a) {
        if (!came[a]) steps[moving[a]] /= 2;
      }
    }
  }

 private:
  void TryAll(Probe& probe, const Jacobians& jacobians, const Indices& moving, const MatrixXd& step,
              std::vector<bool>* came) {
    const Answered there = probe.Closest(Take(places, moving) + step);
    Indices kept;
    for (Index a = 0; a < there.points.cols(); ++a) {
      if (there.found[a]) kept.push_back(a);
    }
    const MatrixXd reached = Take(there.points, kept);
    const Vector values = jacobians.Least(reached);
    for (size_t b = 0; b < kept.size(); ++b) {
      const auto a = static_cast<size_t>(kept[b]);
      const auto column = static_cast<Index>(b);
      if (!(values[column] < least[moving[a]])) continue;
      places.col(moving[a]) = reached.col(column);
      least[moving[a]] = values[column];
      (*came)[a] = true;
    }
  }
};

}  // namespace

// Follows the Jacobian's least singular value down along M, from where it is smallest.
void Examination::EquationsHaveRank() {
  if (probe_.equations() == 0 || !(probe_.size > 0)) return;
  const Jacobians jacobians(probe_);
  const Vector sizes = jacobians.Least(probe_.points);
  Indices order;
  for (Index j = 0; j < sizes.size(); ++j) {
    if (std::isfinite(sizes[j])) order.push_back(j);
  }
  if (order.empty()) return;  // all samples are beyond walls
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return sizes[a] < sizes[b]; });
  const double usual = MedianOf(sizes(order));
  order.resize(std::min(order.size(), static_cast<size_t>(kRankDescents)));
  Descent descent{Take(probe_.points, order), sizes(order)};
  descent.Go(probe_, jacobians);
  Index worst = 0;
  const double lowest = descent.least.minCoeff(&worst);
  if (lowest > kLeastRankShare * usual) return;
  Add("SINGULAR",
      {{"query", Vector(descent.places.col(worst))}, {"ratio", lowest / std::max(usual, 1e-300)}});
}

}  // namespace stellate::doctor
