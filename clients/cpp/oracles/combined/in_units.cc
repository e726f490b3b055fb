#include <algorithm>
#include <charconv>
#include <string_view>
#include <utility>

#include "oracles/combined/common.h"
#include "oracles/combined/units.h"
#include "stellate/oracles/combined.h"

namespace stellate::oracles {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

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

// Takes "[1, 2, 3]", as oracles write a point of R^d, from the front of a text.
bool TakePoint(std::string_view* text, VectorXd* point) {
  std::string_view rest = *text;
  for (Index i = 0; i < point->size(); ++i) {
    const std::string_view before = i == 0 ? "[" : ", ";
    if (!rest.starts_with(before)) return false;
    rest.remove_prefix(before.size());
    const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), (*point)[i]);
    if (error != std::errc()) return false;
    rest.remove_prefix(static_cast<size_t>(end - rest.data()));
  }
  if (!rest.starts_with("]")) return false;
  text->remove_prefix(text->size() - rest.size() + 1);
  return true;
}

// What an oracle of y = x / units says, with its places in x.
std::string InOwnCoordinates(std::string_view words, const VectorXd& units) {
  std::string own;
  VectorXd point(units.size());
  while (!words.empty()) {
    if (TakePoint(&words, &point)) {
      for (Index i = 0; i < point.size(); ++i)
        own += (i == 0 ? "[" : ", ") + Short(point[i] * units[i]);
      own += "]";
    } else {
      own += words.front();
      words.remove_prefix(1);
    }
  }
  return own;
}

template <typename Call>
auto Own(const VectorXd& units, const Call& call) {
  try {
    return call();
  } catch (const OracleError& error) {
    throw OracleError(error.reason(), InOwnCoordinates(error.what(), units));
  }
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

Answer InUnits::ClosestPoint(const MatrixXd& y) {
  return Own(units_, [&] { return scaled_->ClosestPoint(y); });
}

Answer InUnits::IntersectFlat(const MatrixXd& centers, const MatrixXd& bases,
                              const VectorXd& radii) {
  return Own(units_, [&] { return scaled_->IntersectFlat(centers, bases, radii); });
}

MatrixXd InUnits::TangentBasis(const MatrixXd& points) {
  return Own(units_, [&] { return scaled_->TangentBasis(points); });
}

MatrixXd InUnits::EquationGradients(const MatrixXd& points) {
  return Own(units_, [&] { return scaled_->EquationGradients(points); });
}

Answer InUnits::FacePoint(const MatrixXd& y, const Walls& face) {
  return Own(units_, [&] { return scaled_->FacePoint(y, face); });
}

MatrixXd InUnits::Clearances(const MatrixXd& points) {
  return Own(units_, [&] { return scaled_->Clearances(points); });
}

MatrixXd InUnits::Conormals(const MatrixXd& points, const Walls& face) {
  return Own(units_, [&] { return scaled_->Conormals(points, face); });
}

VectorXd InUnits::LocalSize(const Eigen::MatrixXd& points) {
  return own_->LocalSize(points.array().colwise() * units_.array());
}

std::string InUnits::about() const {
  const std::string own = own_->about();
  return AboutUnits(units_) + (own.empty() ? "" : "; ") + own;
}

}  // namespace stellate::oracles
