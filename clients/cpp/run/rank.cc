#include "run/rank.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "shared/equations.h"

namespace stellate::client {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;
using Indices = std::vector<Index>;
using equations::kLeastRankShare, equations::kRankDescents, equations::kRankFirstStep,
    equations::kRankLastStep, equations::kRankRounds, equations::kSeedSpread;

constexpr Index kStarts = 400;
constexpr int kWays = 2;  // that are tried at a time, each forth and back
constexpr double kBeyond = std::numeric_limits<double>::infinity();

double MedianOf(const VectorXd& values) {
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  return (sorted[(sorted.size() - 1) / 2] + sorted[sorted.size() / 2]) / 2;
}

std::string Extent(Index rows, Index columns) {
  return std::to_string(rows) + " x " + std::to_string(columns);
}

double DiagonalOf(const MatrixXd& points) {
  return (points.rowwise().maxCoeff() - points.rowwise().minCoeff()).norm();
}

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  // The engine's output is fixed by the standard, the distributions' is not.
  double Uniform(double low, double high) {
    return low + (high - low) * std::ldexp(static_cast<double>(engine_() >> 11), -53);
  }
  MatrixXd Matrix(Index rows, Index columns) {
    MatrixXd matrix(rows, columns);
    for (double& entry : matrix.reshaped()) entry = Uniform(-1, 1);
    return matrix;
  }

 private:
  std::mt19937_64 engine_;
};

MatrixXd StartsOf(const Oracle& oracle, Random* random) {
  const Index d = oracle.ambient_dimension();
  if (const std::optional<BoundingBox> box = oracle.bounding_box()) {
    const MatrixXd shares = (random->Matrix(d, kStarts).array() + 1) / 2;
    return ((box->upper - box->lower).asDiagonal() * shares).colwise() + box->lower;
  }
  const MatrixXd seeds = oracle.seeds();
  double spread = DiagonalOf(seeds);
  if (spread == 0) spread = seeds.col(0).norm();
  if (spread == 0) spread = 1;
  MatrixXd starts = kSeedSpread * spread * random->Matrix(d, kStarts);
  for (Index j = 0; j < kStarts; ++j) starts.col(j) += seeds.col(j % seeds.cols());
  return starts;
}

struct Closest {
  Indices found;    // of the queries
  MatrixXd points;  // to these
};

Closest Ask(Oracle& oracle, const MatrixXd& x) {
  const Answer answer = oracle.ClosestPoint(x);
  const bool in_shape = answer.points.rows() == x.rows() && answer.points.cols() == x.cols() &&
                        (answer.found.empty() || std::ssize(answer.found) == x.cols());
  if (!in_shape) throw OracleError("ORACLE_SHAPE", "ClosestPoint did not return one point a query");
  Closest closest;
  for (Index j = 0; j < x.cols(); ++j) {
    if (answer.IsFound(j)) closest.found.push_back(j);
  }
  closest.points = answer.points(Eigen::all, closest.found);
  return closest;
}

// The Jacobian of the equations, each by how steep it is usually, so that units do not matter.
class Jacobians {
 public:
  Jacobians(Oracle& oracle, const MatrixXd& points)
      : oracle_(oracle), usual_(VectorXd::Ones(Count())) {
    const std::vector<MatrixXd> all = At(points);
    for (Index i = 0; i < Count(); ++i) {
      VectorXd steep(std::ssize(all));
      for (size_t j = 0; j < all.size(); ++j) steep[static_cast<Index>(j)] = all[j].row(i).norm();
      usual_[i] = std::max(MedianOf(steep), 1e-300);
    }
  }

  // The least singular values at points of M; infinite beyond a wall.
  VectorXd Least(const MatrixXd& points) const {
    VectorXd least(points.cols());
    const std::vector<MatrixXd> all = At(points);
    for (size_t j = 0; j < all.size(); ++j) {
      least[static_cast<Index>(j)] =
          Eigen::JacobiSVD<MatrixXd>(all[j]).singularValues()[Count() - 1];
    }
    if (oracle_.walls() > 0 && points.cols() > 0) {
      const MatrixXd inside = oracle_.Clearances(points);
      least = (inside.colwise().minCoeff().array() < 0).transpose().select(kBeyond, least);
    }
    return least;
  }

  std::vector<MatrixXd> Tangents(const MatrixXd& points) const {
    std::vector<MatrixXd> tangents;
    for (const MatrixXd& one : At(points)) {
      const Eigen::JacobiSVD<MatrixXd> svd(one, Eigen::ComputeFullV);
      tangents.emplace_back(svd.matrixV().rightCols(oracle_.dimension()));
    }
    return tangents;
  }

 private:
  Index Count() const { return oracle_.ambient_dimension() - oracle_.dimension(); }

  std::vector<MatrixXd> At(const MatrixXd& points) const {
    const Index d = oracle_.ambient_dimension();
    const MatrixXd gradients = oracle_.EquationGradients(points);
    if (gradients.rows() != d * Count() || gradients.cols() != points.cols()) {
      throw OracleError("ORACLE_SHAPE",
                        "EquationGradients returned " + Extent(gradients.rows(), gradients.cols()) +
                            " numbers; wanted are " + Extent(d * Count(), points.cols()));
    }
    if (!gradients.allFinite()) {
      throw OracleError("ORACLE_NOT_FINITE",
                        "EquationGradients returned numbers that are not finite");
    }
    std::vector<MatrixXd> all;
    for (const auto& column : gradients.colwise()) {
      all.emplace_back(usual_.cwiseInverse().asDiagonal() *
                       column.reshaped(d, Count()).transpose());
    }
    return all;
  }

  Oracle& oracle_;
  VectorXd usual_;
};

// From points of M downhill along it, by shorter and shorter steps in random ways: far below what
// the value is where they begin, if it has a zero near by, for the last steps are that short.
class Descent {
 public:
  Descent(Oracle& oracle, const Jacobians& jacobians, const MatrixXd& starts, const VectorXd& least)
      : oracle_(oracle), jacobians_(jacobians), places_(starts), least_(least) {}

  void Go(double size, Random* random) {
    VectorXd steps = VectorXd::Constant(places_.cols(), kRankFirstStep * size);
    for (int round = 0; round < kRankRounds; ++round) {
      Indices moving;
      for (Index j = 0; j < steps.size(); ++j) {
        if (steps[j] > kRankLastStep * size) moving.push_back(j);
      }
      if (moving.empty()) return;
      const std::vector<MatrixXd> bases = jacobians_.Tangents(places_(Eigen::all, moving));
      std::vector<bool> came(moving.size(), false);
      for (int way = 0; way < kWays; ++way) {
        MatrixXd step = random->Matrix(places_.rows(), std::ssize(moving));
        for (size_t a = 0; a < moving.size(); ++a) {
          auto column = step.col(static_cast<Index>(a));
          const VectorXd along = bases[a] * (bases[a].transpose() * column);
          column = steps[moving[a]] * along.normalized();
        }
        for (const double side : {1.0, -1.0}) TryAll(moving, side * step, &came);
      }
      for (size_t a = 0; a < moving.size(); ++a) {
        if (!came[a]) steps[moving[a]] /= 2;
      }
    }
  }

  const MatrixXd& places() const { return places_; }
  const VectorXd& least() const { return least_; }

 private:
  void TryAll(const Indices& moving, const MatrixXd& step, std::vector<bool>* came) {
    const Closest there = Ask(oracle_, places_(Eigen::all, moving) + step);
    const VectorXd values = jacobians_.Least(there.points);
    for (size_t b = 0; b < there.found.size(); ++b) {
      const auto a = static_cast<size_t>(there.found[b]);
      const auto column = static_cast<Index>(b);
      if (!(values[column] < least_[moving[a]])) continue;
      places_.col(moving[a]) = there.points.col(column);
      least_[moving[a]] = values[column];
      (*came)[a] = true;
    }
  }

  Oracle& oracle_;
  const Jacobians& jacobians_;
  MatrixXd places_;
  VectorXd least_;
};

}  // namespace

std::optional<Singular> FindSingular(Oracle& oracle, std::uint64_t random_seed) {
  if (oracle.equations() == 0) return std::nullopt;
  Random random(random_seed);
  const MatrixXd points = Ask(oracle, StartsOf(oracle, &random)).points;
  if (points.cols() == 0) return std::nullopt;
  const double size = DiagonalOf(points);
  if (!(size > 0)) return std::nullopt;
  const Jacobians jacobians(oracle, points);
  const VectorXd sizes = jacobians.Least(points);
  Indices order;
  for (Index j = 0; j < sizes.size(); ++j) {
    if (std::isfinite(sizes[j])) order.push_back(j);
  }
  if (order.empty()) return std::nullopt;  // all of them are beyond walls
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return sizes[a] < sizes[b]; });
  const double usual = MedianOf(sizes(order));
  order.resize(std::min(order.size(), static_cast<size_t>(kRankDescents)));
  Descent descent(oracle, jacobians, points(Eigen::all, order), sizes(order));
  descent.Go(size, &random);
  Index worst = 0;
  const double lowest = descent.least().minCoeff(&worst);
  if (lowest > kLeastRankShare * usual) return std::nullopt;
  return Singular{descent.places().col(worst), lowest / std::max(usual, 1e-300)};
}

}  // namespace stellate::client
