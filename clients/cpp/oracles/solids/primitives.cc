#include <cmath>

#include "oracles/combined/common.h"
#include "oracles/solids/single.h"
#include "stellate/solids.h"

namespace stellate::solids {
namespace {

using Eigen::Index, Eigen::Vector3d, Eigen::VectorXd;
using oracles::Refuse, oracles::Short;

double Length(double value, const char* what) {
  if (std::isfinite(value) && value > 0) return value;
  Refuse(std::string(what) + " has to be a length above 0, and is " + Short(value));
}

void CheckPoint(const VectorXd& point, const char* what) {
  if (point.size() < 1 || !point.allFinite()) {
    Refuse(std::string(what) + " has to be a point of R^d, of finite numbers");
  }
}

Vector3d Direction(const Vector3d& axis) {
  if (axis.allFinite() && axis.norm() > 0) return axis / axis.norm();
  Refuse("an axis has to be a vector other than 0");
}

// A profile about the z axis, about another one.
WallPtr About(ProfilePtr profile, const Vector3d& axis, const Vector3d& at) {
  return Place(std::move(profile), {TurnTo(axis), 1, at});
}

// The middles of the ends of what stands along an axis, and the planes of these.
struct Ends {
  Eigen::Matrix<double, 3, 2> middles;
  NodePtr lower, upper;
};
Ends EndsOf(const Vector3d& axis, const Vector3d& at, double height) {
  const double middle = axis.dot(at), half = height / 2;
  Ends ends{{},
            Half(std::make_shared<Plane>(axis, middle - half)),
            Half(std::make_shared<Plane>(-axis, -middle - half))};
  ends.middles << at - half * axis, at + half * axis;
  return ends;
}

WallPtr TurnedTo(bool inside, WallPtr wall) { return inside ? wall : Opposite(std::move(wall)); }

}  // namespace

Single SingleOf(const NodePtr& tree, const std::string& what) {
  Single single{true, nullptr, nullptr};
  const Node* node = tree.get();
  while (node->kind != Node::Kind::kHalf) {
    const bool is_not = node->kind == Node::Kind::kNot;
    if (!is_not && (node->kind != Node::Kind::kAll || node->parts.size() != 1)) {
      Refuse(
          what +
          " solids of one wall, as balls, tori, capsules, cylinders without ends and half-spaces "
          "are; this has edges, or several walls");
    }
    if (is_not) single.inside = !single.inside;
    if (!is_not) single.hull = node->hull;
    node = node->parts.front().get();
  }
  single.wall = node->wall;
  return single;
}

Solid Ball(double radius, const VectorXd& at) {
  CheckPoint(at, "the centre");
  Length(radius, "the radius");
  const Index d = at.size();
  const BodyPtr hull = HullOf(Discs{at, VectorXd::Unit(d, 0), {0}, radius});
  const WallPtr wall = Place(Round(radius), {Eigen::MatrixXd::Identity(d, d), 1, at});
  return {All({Half(wall)}, hull), static_cast<int>(d)};
}

Solid Box(const VectorXd& lower, const VectorXd& upper) {
  CheckPoint(lower, "the lower corner");
  CheckPoint(upper, "the upper corner");
  const Index d = lower.size();
  if (upper.size() != d || !(lower.array() < upper.array()).all()) {
    Refuse("a box needs two corners of one space, the lower one first");
  }
  std::vector<NodePtr> sides;
  for (Index i = 0; i < d; ++i) {
    sides.push_back(Half(std::make_shared<Plane>(VectorXd::Unit(d, i), lower[i])));
  }
  for (Index i = 0; i < d; ++i) {
    sides.push_back(Half(std::make_shared<Plane>(-VectorXd::Unit(d, i), -upper[i])));
  }
  return {All(std::move(sides), HullOf(lower, upper)), static_cast<int>(d)};
}

Solid HalfSpace(const VectorXd& normal, double offset) {
  CheckPoint(normal, "the normal");
  if (!(normal.norm() > 0) || !std::isfinite(offset)) {
    Refuse("a half-space needs a normal other than 0, and a finite offset");
  }
  return {Half(std::make_shared<Plane>(normal, offset)), static_cast<int>(normal.size())};
}

Solid Cylinder(double radius, std::optional<double> height, const Vector3d& axis,
               const Vector3d& at) {
  const Vector3d along = Direction(axis);
  CheckPoint(at, "the centre");
  const NodePtr side = Half(About(Tube(Length(radius, "the radius")), along, at));
  if (!height) return {All({side}, HullOf(Discs{at, along, {radius}, 0, true})), 3};
  const Ends ends = EndsOf(along, at, Length(*height, "the height"));
  return {All({side, ends.lower, ends.upper}, HullOf(Discs{ends.middles, along, {radius, radius}})),
          3};
}

Solid Cone(double radius, double height, double top, const Vector3d& axis, const Vector3d& at) {
  const Vector3d along = Direction(axis);
  CheckPoint(at, "the middle");
  Length(radius, "the radius");
  Length(height, "the height");
  if (top != 0) Length(top, "the radius at the top");
  const NodePtr side = Half(About(Taper((radius + top) / 2, (top - radius) / height), along, at));
  const Ends ends = EndsOf(along, at, height);
  std::vector<NodePtr> walls = {side, ends.lower};
  if (top > 0) walls.push_back(ends.upper);  // else the side ends at its tip by itself
  return {All(std::move(walls), HullOf(Discs{ends.middles, along, {radius, top}})), 3};
}

Solid Torus(double major, double minor, const Vector3d& axis, const Vector3d& at) {
  const Vector3d along = Direction(axis);
  CheckPoint(at, "the centre");
  Length(major, "the major radius");
  Length(minor, "the minor radius");
  if (!(minor < major)) {
    Refuse("a torus needs minor < major, not " + Short(minor) + " and " + Short(major));
  }
  return {
      All({Half(About(Ring(major, minor), along, at))}, HullOf(Discs{at, along, {major}, minor})),
      3};
}

Solid Capsule(const Vector3d& start, const Vector3d& end, double radius) {
  CheckPoint(start, "the start");
  CheckPoint(end, "the end");
  Length(radius, "the radius");
  const double size = (end - start).norm();
  if (!(size > 0)) Refuse("a capsule needs two points that differ; Ball is for one");
  const Vector3d along = (end - start) / size;
  Eigen::Matrix<double, 3, 2> middles;
  middles << start, end;
  return {All({Half(About(Pill(size / 2, radius), along, (start + end) / 2))},
              HullOf(Discs{middles, along, {0, 0}, radius})),
          3};
}

Solid Implicit(std::function<double(const VectorXd& x)> g,
               std::function<VectorXd(const VectorXd& x)> gradient,
               const ImplicitOptions& options) {
  if (!g) Refuse("Implicit takes a function");
  int d = options.dimension;
  BodyPtr hull;
  if (const auto& box = options.bounding_box) {
    CheckPoint(box->lower, "the lower corner");
    CheckPoint(box->upper, "the upper corner");
    if (box->lower.size() != box->upper.size() ||
        !(box->lower.array() < box->upper.array()).all()) {
      Refuse("a bounding box needs two corners of one space, the lower one first");
    }
    d = static_cast<int>(box->lower.size());
    hull = HullOf(box->lower, box->upper);
  }
  if (d < 1) Refuse("the dimension has to be 1 or more, and is " + std::to_string(d));
  const WallPtr wall =
      Place(Given(std::move(g), std::move(gradient), options.distance), Motion::None(d));
  return {All({Half(wall)}, hull), d};
}

Solid Blend(const Solid& a, const Solid& b, double radius, Join join) {
  if (a.dimension() != b.dimension()) Refuse("Blend takes two solids of the same R^d");
  Length(radius, "the radius");
  const Single first = SingleOf(a.tree(), "Blend takes"),
               second = SingleOf(b.tree(), "Blend takes");
  // An intersection is the outside of the union of the outsides.
  const bool is_union = join == Join::kUnion;
  const WallPtr wall = Place(
      Blended(TurnedTo(is_union, TurnedTo(first.inside, first.wall)),
              TurnedTo(join != Join::kIntersection, TurnedTo(second.inside, second.wall)), radius),
      Motion::None(a.dimension()));
  const BodyPtr hull = first.inside ? first.hull : nullptr;
  if (!is_union) return {All({Half(Opposite(wall))}, hull), a.dimension()};
  const BodyPtr other = second.inside ? second.hull : nullptr;
  const bool ends = hull != nullptr && other != nullptr;
  return {All({Half(wall)}, ends ? HullOf(std::vector{hull, other}) : nullptr), a.dimension()};
}

}  // namespace stellate::solids
