#include <algorithm>
#include <utility>

#include "oracles/combined/common.h"
#include "oracles/combined/units.h"
#include "stellate/oracles/combined.h"

namespace stellate::oracles {
namespace {

using Eigen::Index, Eigen::VectorXd;

std::shared_ptr<Oracle> Divided(const std::shared_ptr<Oracle>& oracle, const VectorXd& units) {
  if (std::shared_ptr<Oracle> made = oracle->DividedBy(units)) return made;
  if ((units.array() == units[0]).all() && oracle->walls() == 0)
    return std::make_shared<Transformed>(oracle, Similarity{{}, 1 / units[0], {}});
  Refuse(
      "scale is for oracles of equations, walls, solids and charts: this one answers with what is "
      "nearest in its own coordinates, and in scaled ones another point is. Scale what it is made "
      "of, as the points of a cloud, and then the mesh's points back; or let it override "
      "DividedBy");
}

}  // namespace

VectorXd UnitsOf(const VectorXd& scale, Index d) {
  VectorXd units = scale;
  if (scale.size() == 1) units = VectorXd::Constant(d, scale[0]);
  if (units.size() != d || !units.allFinite() || !(units.array() > 0).all())
    Refuse("scale has to be " + std::to_string(d) +
           " positive numbers, one for each axis, or one for all");
  return units;
}

std::string AboutUnits(const VectorXd& units) {
  constexpr Index kMostNamed = 8;
  std::string named;
  for (Index i = 0; i < std::min(kMostNamed, units.size()); ++i)
    named += (i > 0 ? ", " : "") + Short(units[i]);
  return "coordinates were divided by " + named + (units.size() > kMostNamed ? ", ..." : "") +
         ", and lengths and angles are of these";
}

InUnits::InUnits(std::shared_ptr<Oracle> oracle, const VectorXd& scale) : own_(std::move(oracle)) {
  if (own_ == nullptr) Refuse("InUnits needs an oracle");
  units_ = UnitsOf(scale, own_->ambient_dimension());
  if (own_->coordinate_scale().size() > 0) Refuse("the oracle has a scale already");
  scaled_ = Divided(own_, units_);
}

VectorXd InUnits::LocalSize(const Eigen::MatrixXd& points) {
  return own_->LocalSize(points.array().colwise() * units_.array());
}

std::string InUnits::about() const {
  const std::string own = own_->about();
  return AboutUnits(units_) + (own.empty() ? "" : "; ") + own;
}

}  // namespace stellate::oracles
