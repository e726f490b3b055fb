#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <vector>

#include "stellate/pointwise.h"

namespace stellate::oracles {

// A smooth map of a box of R^k into R^d, an immersion on all of it.
struct Chart {
  std::function<Eigen::VectorXd(const Eigen::VectorXd& u)> x;           // k -> d
  std::function<Eigen::MatrixXd(const Eigen::VectorXd& u)> derivative;  // d x k; empty: differences
  Eigen::VectorXd lower, upper;                                         // k each
  // Whether a parameter comes back to where it was at the end of its interval: of each, or one
  // answer for all; empty: none does.
  std::vector<bool> periodic;
};

// A closed manifold that is covered by charts.
//
//   stellate::oracles::Chart chart;  // a circle
//   chart.x = [](const auto& u) { return Eigen::Vector2d(std::cos(u[0]), std::sin(u[0])); };
//   chart.lower = Eigen::VectorXd::Zero(1);
//   chart.upper = Eigen::VectorXd::Constant(1, 2 * std::numbers::pi);
//   chart.periodic = {true};
//   const auto circle = std::make_shared<stellate::oracles::Parametrized>(chart);
//
// Where a parameter is not periodic, the images of other charts have to go on beyond the end of its
// interval, by some margin: a nearest point at the end of an interval is none. A sphere in angles
// has no derivative of full rank at its poles and takes two charts.
//
// A closest point is sought by Newton's method from the nearest of some 20,000 points of the
// charts, which is the right one where M does not fold more finely than they lie. The maps are
// called from several threads where the oracle is.
class Parametrized final : public PointwiseOracle {
 public:
  // Throws std::invalid_argument, and OracleError for a map that rounds to single precision.
  explicit Parametrized(std::vector<Chart> charts);
  explicit Parametrized(Chart chart) : Parametrized(std::vector<Chart>{std::move(chart)}) {}
  ~Parametrized() override;

  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override;
  std::optional<BoundingBox> bounding_box() const override;
  std::shared_ptr<Oracle> DividedBy(const Eigen::VectorXd& scale) const override;

  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override;
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override;

 private:
  class Atlas;
  explicit Parametrized(std::unique_ptr<const Atlas> atlas);

  std::unique_ptr<const Atlas> atlas_;
};

}  // namespace stellate::oracles
