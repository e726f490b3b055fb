#include <memory>
#include <string>

#include "oracles/combined/common.h"
#include "oracles/ready/grid_check.h"
#include "oracles/ready/grid_spline.h"
#include "stellate/oracles/equations.h"

namespace stellate::oracles {
namespace {

ImplicitOracle::Function Shifted(SignedDistance::Function f, double level) {
  if (!f) Refuse("a signed distance has to be a function");
  return [f = std::move(f), level](const Eigen::VectorXd& x) {
    return Eigen::VectorXd::Constant(1, f(x) - level);
  };
}

ImplicitOracle::Jacobian AsRow(SignedDistance::Gradient gradient) {
  if (!gradient) return {};
  return [gradient = std::move(gradient)](const Eigen::VectorXd& x) -> Eigen::MatrixXd {
    return gradient(x).transpose();
  };
}

}  // namespace

// The base class keeps the box.
// NOLINTNEXTLINE(performance-unnecessary-value-param)
SignedDistance::SignedDistance(Function f, Gradient gradient, BoundingBox box, double level)
    : ImplicitOracle(static_cast<int>(box.lower.size()) - 1, static_cast<int>(box.lower.size()),
                     Shifted(std::move(f), level), AsRow(std::move(gradient)), box) {}

SignedDistance SignedDistance::OfGrid(const Eigen::VectorXd& values, const std::vector<int>& shape,
                                      const BoundingBox& box, double level, GridBorder border) {
  GridSpline::Check(values, shape, box);
  const bool open = border == GridBorder::kOpen;
  const double outside = InsistOnASurface({values, shape, box}, level, open);
  const WiderGrid wider =
      open ? GoneOnStraight({values, shape, box}) : WiderGrid{values, shape, box};
  const auto spline =
      std::make_shared<const GridSpline>(wider.values, wider.shape, wider.box, open ? 0 : outside);
  SignedDistance oracle([spline](const Eigen::VectorXd& x) { return spline->Value(x); },
                        [spline](const Eigen::VectorXd& x) { return spline->Gradient(x); }, box,
                        level);
  oracle.resolution_ = spline->spacing();
  std::string counts;
  for (const int count : shape) counts += (counts.empty() ? "" : " x ") + std::to_string(count);
  oracle.about_ =
      "a spline through " + counts + " values on a grid, spacing " + Short(oracle.resolution_);
  return oracle;
}

}  // namespace stellate::oracles
