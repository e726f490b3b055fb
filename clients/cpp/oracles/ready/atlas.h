#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "oracles/ready/point_tree.h"
#include "stellate/oracles/parametrized.h"

namespace stellate::oracles {

// A chart whose box and values are checked. Parameters are columns of length k, points of length d.
class CheckedChart {
 public:
  CheckedChart(Chart chart, size_t number);

  Eigen::Index k() const { return chart_.lower.size(); }
  const Eigen::VectorXd& lower() const { return chart_.lower; }
  const Eigen::VectorXd& upper() const { return chart_.upper; }
  const Eigen::VectorXd& extent() const { return extent_; }
  bool wraps(Eigen::Index a) const { return chart_.periodic[static_cast<size_t>(a)]; }

  // Throws OracleError where the map rounds to single precision.
  void InsistOnExactness() const;
  // The chart of the points divided by these, (d).
  Chart DividedBy(const Eigen::VectorXd& scale) const;
  // Throws std::runtime_error for values of another length than the first's.
  Eigen::VectorXd Point(const Eigen::VectorXd& u) const;
  // d x k, as given or by central differences within the box.
  Eigen::MatrixXd Slopes(const Eigen::VectorXd& u) const;
  // The second derivative of r . X, k x k.
  Eigen::MatrixXd Bend(const Eigen::VectorXd& u, const Eigen::VectorXd& r) const;
  // Periodic parameters wrapped, others held in the box.
  Eigen::VectorXd Inside(const Eigen::VectorXd& u) const;

 private:
  Chart chart_;
  Eigen::VectorXd extent_;
  mutable Eigen::Index d_ = 0;  // set by the first point, while it is made
  std::string name_;
};

// The charts, and a grid of points on each to begin searches from.
class Parametrized::Atlas {
 public:
  explicit Atlas(std::vector<Chart> charts);

  int dimension() const { return static_cast<int>(charts_.front().k()); }
  int ambient_dimension() const { return static_cast<int>(tree_->points().rows()); }
  const Eigen::MatrixXd& points() const { return tree_->points(); }
  std::vector<Chart> DividedBy(const Eigen::VectorXd& scale) const;

  // The nearest point of M and an orthonormal basis (d x k) of its tangent space.
  bool Closest(const Eigen::VectorXd& x, Eigen::VectorXd& y, Eigen::MatrixXd& basis) const;
  // Where basis^T (y - center) = 0, the nearest to the center and within the radius.
  bool Meet(const Eigen::VectorXd& center, const Eigen::MatrixXd& basis, double radius,
            Eigen::VectorXd& y) const;

 private:
  struct Beginning {
    const CheckedChart* chart;
    Eigen::VectorXd u;
  };
  void Sample();
  void InsistOnComingRound() const;
  std::vector<Beginning> Beginnings(const Eigen::VectorXd& x) const;
  bool Apart(Eigen::Index a, Eigen::Index b) const;
  bool Descend(const Beginning& from, const Eigen::VectorXd& x, Eigen::VectorXd& y,
               Eigen::MatrixXd& basis) const;
  bool MeetFrom(const Beginning& from, const Eigen::VectorXd& center, const Eigen::MatrixXd& basis,
                Eigen::VectorXd& y) const;

  std::vector<CheckedChart> charts_;
  Eigen::MatrixXd grid_;       // k x m, parameters
  std::vector<size_t> owner_;  // m: the chart of each
  int per_side_ = 0;
  std::unique_ptr<const PointTree> tree_;
  double scale_ = 0;  // of M: the unit of lengths
};

}  // namespace stellate::oracles
