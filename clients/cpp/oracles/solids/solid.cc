#include <cmath>
#include <mutex>
#include <set>

#include "oracles/combined/common.h"
#include "oracles/solids/arrangement.h"
#include "oracles/solids/single.h"
#include "stellate/solids.h"

namespace stellate::solids {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;
using oracles::Refuse, oracles::Short;

constexpr double kMargin = 0.15;      // of a solid's sides, around it
constexpr double kOrthogonal = 1e-9;  // what a product of rotations is far below
constexpr size_t kMostWalls = 64;     // that a server takes
constexpr size_t kMostMaterials = 127;

WallPtr OnSide(const WallPtr& wall, bool positive) {
  if (positive) return wall;
  if (const auto* const plane = dynamic_cast<const Plane*>(wall.get())) {
    return std::make_shared<Plane>(-plane->normal(), -plane->level());
  }
  return Opposite(wall);
}

std::vector<oracles::Wall> AsFunctions(const std::vector<WallPtr>& walls) {
  std::vector<oracles::Wall> functions;
  functions.reserve(walls.size());
  for (const WallPtr& wall : walls) functions.push_back(AsFunctions(wall));
  return functions;
}

BoundingBox BoxOf(const Node& tree, int dimension) {
  VectorXd lower(dimension), upper(dimension);
  for (Index i = 0; i < dimension; ++i) {
    upper[i] = Support(tree, VectorXd::Unit(dimension, i));
    lower[i] = -Support(tree, -VectorXd::Unit(dimension, i));
  }
  if (!lower.allFinite() || !upper.allFinite()) {
    Refuse(
        "the solid goes on without end, or is not known to end: cut it by a box, solid & "
        "Box(lower, "
        "upper)");
  }
  if (!(lower.array() < upper.array()).all()) {
    Refuse("the solid is empty: its parts lie apart from each other");
  }
  const VectorXd margin = kMargin * (upper - lower);
  return {lower - margin, upper + margin};
}

// The half-walls of an intersection; nothing for another solid, and `why_not` says why.
std::optional<std::vector<WallPtr>> HalvesOf(const NodePtr& tree, std::string* why_not) {
  const Arrangement arrangement(Simplified(tree));
  const auto literals = arrangement.Literals(why_not);
  if (!literals) return std::nullopt;
  if (literals->size() > kMostWalls) {
    Refuse("the solid has " + std::to_string(literals->size()) + " walls; there may be " +
           std::to_string(kMostWalls));
  }
  std::vector<WallPtr> walls;
  walls.reserve(literals->size());
  for (const auto& [i, positive] : *literals) {
    walls.push_back(OnSide(arrangement.walls()[i], positive));
  }
  return walls;
}

// Signs that no point has count as outside, of which nothing is seen.
oracles::Solid WithLabels(std::vector<WallPtr> walls, Labelling labels, BoundingBox around) {
  LeaveOutIdle(&walls, &labels);
  for (std::int8_t& label : labels) label = std::max<std::int8_t>(label, 0);
  return {AsFunctions(walls), std::move(around), {}, {labels.begin(), labels.end()}};
}

oracles::Solid OracleOf(const NodePtr& tree, int dimension) {
  std::string why_not;
  if (const auto halves = HalvesOf(tree, &why_not)) {
    return {AsFunctions(*halves), BoxOf(*tree, dimension)};
  }
  const Arrangement arrangement(Simplified(tree));
  return WithLabels(arrangement.walls(), arrangement.Labels(), BoxOf(*tree, dimension));
}

oracles::Solid OracleOf(const std::vector<std::pair<std::string, Solid>>& materials) {
  std::vector<NodePtr> trees, whole;
  for (const auto& [name, solid] : materials) {
    trees.push_back(Simplified(solid.tree()));
    whole.push_back(solid.tree());
  }
  const Arrangement arrangement(Either(trees));
  Labelling labels = arrangement.Labels();
  for (size_t number = 0; number < trees.size(); ++number) {
    const std::vector<bool> inside = arrangement.Inside(*trees[number]);
    for (size_t code = 0; code < labels.size(); ++code) {
      if (labels[code] > 0 && inside[code]) labels[code] = static_cast<std::int8_t>(number + 1);
    }
  }
  for (size_t number = 0; number < trees.size(); ++number) {
    if (std::find(labels.begin(), labels.end(), number + 1) == labels.end()) {
      Refuse("there is nothing of the material '" + materials[number].first +
             "': it is empty, or later ones cover it");
    }
  }
  return WithLabels(arrangement.walls(), std::move(labels),
                    BoxOf(*Either(whole), materials.front().second.dimension()));
}

}  // namespace

struct Composed::Lazy {
  std::once_flag once;
  std::function<oracles::Solid()> make;
  std::optional<oracles::Solid> made;
};

Composed::Composed(int dimension, std::function<oracles::Solid()> make)
    : dimension_(dimension), lazy_(std::make_shared<Lazy>()) {
  lazy_->make = std::move(make);
}

oracles::Solid& Composed::made() const {
  std::call_once(lazy_->once, [this] { lazy_->made.emplace(lazy_->make()); });
  return *lazy_->made;
}

Solid::Solid(NodePtr tree, int dimension)
    : Composed(dimension, [tree, dimension] { return OracleOf(tree, dimension); }),
      tree_(std::move(tree)) {}

Solid Solid::Joined(const Solid& other, NodePtr tree) const {
  if (other.dimension() == dimension()) return {std::move(tree), dimension()};
  Refuse("a solid of R^" + std::to_string(dimension()) + " and one of R^" +
         std::to_string(other.dimension()) + " cannot be joined");
}

Solid Solid::operator&(const Solid& other) const {
  return Joined(other, All({tree_, other.tree_}));
}
Solid Solid::operator|(const Solid& other) const {
  return Joined(other, Either({tree_, other.tree_}));
}
Solid Solid::operator-(const Solid& other) const {
  return Joined(other, All({tree_, Not(other.tree_)}));
}
Solid Solid::operator^(const Solid& other) const {
  return Joined(other, Either({All({tree_, Not(other.tree_)}), All({other.tree_, Not(tree_)})}));
}
Solid Solid::operator~() const {
  const bool is_not = tree_->kind == Node::Kind::kNot;
  return {is_not ? tree_->parts.front() : Not(tree_), dimension()};
}

Solid Solid::At(const VectorXd& point) const {
  if (point.size() != dimension() || !point.allFinite()) {
    Refuse("a solid of R^" + std::to_string(dimension()) + " is moved by " +
           std::to_string(dimension()) + " finite numbers");
  }
  const MatrixXd turn = MatrixXd::Identity(dimension(), dimension());
  return {Moved(tree_, {turn, 1, point}), dimension()};
}

Solid Solid::Rotated(const MatrixXd& rotation) const {
  const Index d = dimension();
  if (rotation.rows() != d || rotation.cols() != d ||
      !((rotation * rotation.transpose() - MatrixXd::Identity(d, d)).cwiseAbs().maxCoeff() <=
        kOrthogonal)) {
    Refuse("a rotation has to be an orthogonal matrix, " + std::to_string(d) + " x " +
           std::to_string(d) + "; Eigen::AngleAxisd makes one of space");
  }
  return {Moved(tree_, {rotation, 1, VectorXd::Zero(d)}), dimension()};
}

Solid Solid::Scaled(double factor) const {
  if (!std::isfinite(factor) || !(factor > 0)) {
    Refuse("the factor has to be above 0, and is " + Short(factor));
  }
  const Index d = dimension();
  return {Moved(tree_, {MatrixXd::Identity(d, d), factor, VectorXd::Zero(d)}), dimension()};
}

Solid Solid::Offset(double distance) const {
  const Single single = SingleOf(tree_, "Offset takes");
  const double outwards = single.inside ? distance : -distance;
  WallPtr moved = single.wall->Offset(outwards);
  if (moved == nullptr) {
    Refuse("the solid cannot be offset by " + Short(distance) +
           ": its wall's values are no distances, or nothing would be left");
  }
  NodePtr tree = All({Half(std::move(moved))},
                     single.hull == nullptr ? nullptr : Grown(single.hull, outwards));
  return {single.inside ? std::move(tree) : Not(std::move(tree)), dimension()};
}

bool Solid::Contains(const VectorXd& x) const {
  if (x.size() != dimension()) Refuse("the point is not one of R^" + std::to_string(dimension()));
  const Arrangement arrangement(tree_);
  std::vector<bool> signs;
  for (const WallPtr& wall : arrangement.walls()) signs.push_back(wall->Value(x) > 0);
  return arrangement.InsideAt(signs);
}

LabelTable Solid::Table() const {
  const Arrangement arrangement(Simplified(tree_));
  return {AsFunctions(arrangement.walls()), arrangement.Labels()};
}

std::vector<oracles::Wall> Solid::HalfWalls() const {
  std::string why_not;
  const auto halves = HalvesOf(tree_, &why_not);
  if (halves) return AsFunctions(*halves);
  Refuse("the solid is no intersection of half-walls: " + why_not +
         ". It can be meshed; what has half-walls, to cut another manifold by, are intersections "
         "(&), and differences from which a single wall is taken, as of a cylinder that goes "
         "through");
}

Labels::Labels(std::vector<std::pair<std::string, Solid>> materials)
    : Composed(materials.empty() ? 0 : materials.front().second.dimension(),
               [materials] { return OracleOf(materials); }) {
  if (materials.empty() || materials.size() > kMostMaterials) {
    Refuse("there are " + std::to_string(materials.size()) + " materials; there may be 1 to " +
           std::to_string(kMostMaterials));
  }
  for (auto& [name, solid] : materials) {
    if (solid.dimension() != dimension()) {
      Refuse("the material '" + name + "' is a solid of R^" + std::to_string(solid.dimension()) +
             ", and the first one of R^" + std::to_string(dimension()));
    }
    if (std::find(names_.begin(), names_.end(), name) != names_.end()) {
      Refuse("there are two materials '" + name + "'");
    }
    names_.push_back(std::move(name));
  }
}

int Labels::LabelOf(std::string_view name) const {
  const auto at = std::find(names_.begin(), names_.end(), name);
  if (at == names_.end()) Refuse("there is no material '" + std::string(name) + "'");
  return static_cast<int>(at - names_.begin()) + 1;
}

}  // namespace stellate::solids
