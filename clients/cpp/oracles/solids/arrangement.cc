#include "oracles/solids/arrangement.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "oracles/combined/common.h"

namespace stellate::solids {
namespace {

using Kind = Node::Kind;
using oracles::Refuse;
using Cubes = std::vector<std::vector<Literal>>;

bool Bit(size_t code, size_t i) { return (code >> i & 1) != 0; }

void AddOfParallels(size_t i, const Plane& one, size_t j, const Plane& other, Cubes* cubes) {
  for (const double sign : {1.0, -1.0}) {
    if ((one.normal() - sign * other.normal()).cwiseAbs().maxCoeff() > kRounding) continue;
    // Along one's normal, `other` begins or ends at this level.
    const double level = sign * other.level();
    const bool beyond = sign > 0;  // the side of `other` that lies at higher levels
    if (one.level() > level) {
      cubes->push_back({{i, true}, {j, !beyond}});
    } else {
      cubes->push_back({{i, false}, {j, beyond}});
    }
  }
}

void AddOfBalls(size_t i, const Sphere& one, size_t j, const Sphere& other, Cubes* cubes) {
  const double apart = (one.centre - other.centre).norm();
  if (apart >= one.radius + other.radius) {
    cubes->push_back({{i, true}, {j, true}});
  } else if (apart <= std::abs(one.radius - other.radius)) {
    const auto [small, large] = one.radius < other.radius ? std::pair(i, j) : std::pair(j, i);
    cubes->push_back({{small, true}, {large, false}});
  }
}

std::string InWords(size_t walls, size_t fixed) {
  if (fixed == 0) {
    return "of its " + std::to_string(walls) +
           " walls none has one sign throughout the inside, as in a union";
  }
  return "of its " + std::to_string(walls) + " walls " + std::to_string(fixed) +
         " have one sign throughout the inside, and these signs do not distinguish it from what is "
         "outside, as where two solids are joined, or a corner is cut away";
}

}  // namespace

Arrangement::Arrangement(NodePtr tree) : tree_(std::move(tree)) {
  for (const WallPtr& wall : WallsOf(*tree_)) {
    if (numbers_.contains(wall.get())) continue;
    Literal number{walls_.size(), true};
    for (size_t i = 0; i < walls_.size(); ++i) {
      const int side = walls_[i]->Like(*wall);
      if (side == 0) continue;
      number = {i, side > 0};
      break;
    }
    if (number.first == walls_.size()) walls_.push_back(wall);
    numbers_[wall.get()] = number;
  }
}

Labelling Arrangement::Labels() const {
  if (walls_.size() > kMostInTables) {
    Refuse("the solid has " + std::to_string(walls_.size()) +
           " walls, and a table of all their signs is made of " + std::to_string(kMostInTables) +
           " at most");
  }
  const std::vector<bool> inside = Inside(*tree_);
  Labelling labels(inside.begin(), inside.end());
  for (const std::vector<Literal>& cube : Impossible()) {
    for (size_t code = 0; code < labels.size(); ++code) {
      if (std::all_of(cube.begin(), cube.end(), [code](const Literal& literal) {
            return Bit(code, literal.first) == literal.second;
          })) {
        labels[code] = -1;
      }
    }
  }
  return labels;
}

std::vector<bool> Arrangement::Inside(const Node& node) const {
  std::vector<bool> inside(size_t{1} << walls_.size());
  std::vector<bool> signs(walls_.size());
  for (size_t code = 0; code < inside.size(); ++code) {
    for (size_t i = 0; i < signs.size(); ++i) signs[i] = Bit(code, i);
    inside[code] = InsideAt(node, signs);
  }
  return inside;
}

bool Arrangement::InsideAt(const std::vector<bool>& signs) const { return InsideAt(*tree_, signs); }

bool Arrangement::InsideAt(const Node& node, const std::vector<bool>& signs) const {
  const auto is_inside = [&](const NodePtr& part) { return InsideAt(*part, signs); };
  switch (node.kind) {
    case Kind::kHalf: {
      const auto [i, same] = Number(*node.wall);
      return signs[i] == same;
    }
    case Kind::kNot:
      return !is_inside(node.parts.front());
    case Kind::kAll:
      return std::all_of(node.parts.begin(), node.parts.end(), is_inside);
    case Kind::kEither:
      break;
  }
  return std::any_of(node.parts.begin(), node.parts.end(), is_inside);
}

std::optional<std::vector<Literal>> Arrangement::Literals(std::string* why_not) const {
  if (walls_.size() <= kMostInTables) return Fewest(Labels(), why_not);
  const auto conjunction = Conjunction(*tree_);
  if (!conjunction) {
    Refuse("the solid has " + std::to_string(walls_.size()) + " walls, and of more than " +
           std::to_string(kMostInTables) +
           " only what is written as an intersection of half-walls can be meshed: a & b, or a - b "
           "for a b of one wall");
  }
  return std::vector<Literal>(conjunction->begin(), conjunction->end());
}

std::optional<std::vector<Literal>> Arrangement::Fewest(const Labelling& labels,
                                                        std::string* why_not) const {
  const auto first = std::find_if(labels.begin(), labels.end(), [](int l) { return l > 0; });
  if (first == labels.end()) {
    Refuse("the solid is empty: no point has the signs that it asks for");
  }
  if (std::find(labels.begin(), labels.end(), 0) == labels.end()) {
    Refuse("the solid is all of space: it has no walls");
  }
  const auto start = static_cast<size_t>(first - labels.begin());
  std::vector<Literal> fixed;
  for (size_t i = 0; i < walls_.size(); ++i) {
    const bool sign = Bit(start, i);
    bool always = true;
    for (size_t code = start; code < labels.size(); ++code) {
      always = always && (labels[code] <= 0 || Bit(code, i) == sign);
    }
    if (always) fixed.emplace_back(i, sign);
  }
  // Whether points that have these signs are all inside.
  const auto is_all = [&labels](const std::vector<Literal>& some) {
    for (size_t code = 0; code < labels.size(); ++code) {
      if (labels[code] == 0 && std::all_of(some.begin(), some.end(), [code](const Literal& l) {
            return Bit(code, l.first) == l.second;
          })) {
        return false;
      }
    }
    return true;
  };
  if (!is_all(fixed)) {
    *why_not = InWords(walls_.size(), fixed.size());
    return std::nullopt;
  }
  for (size_t i = fixed.size(); i-- > 0;) {
    std::vector<Literal> fewer = fixed;
    fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(i));
    if (is_all(fewer)) fixed = std::move(fewer);
  }
  return fixed;
}

std::optional<std::set<Literal>> Arrangement::Conjunction(const Node& node, bool positive) const {
  if (node.kind == Kind::kHalf) {
    const auto [i, same] = Number(*node.wall);
    return std::set<Literal>{{i, same == positive}};
  }
  if (node.kind == Kind::kNot) return Conjunction(*node.parts.front(), !positive);
  if ((node.kind == Kind::kAll) != positive && node.parts.size() != 1) return std::nullopt;
  std::set<Literal> signs;
  for (const NodePtr& part : node.parts) {
    const auto some = Conjunction(*part, positive);
    if (!some) return std::nullopt;
    signs.insert(some->begin(), some->end());
  }
  for (const auto& [i, sign] : signs) {
    if (signs.contains({i, !sign})) return std::nullopt;
  }
  return signs;
}

Cubes Arrangement::Impossible() const {
  Cubes cubes;
  for (size_t i = 0; i < walls_.size(); ++i) {
    const auto* const plane = dynamic_cast<const Plane*>(walls_[i].get());
    const std::optional<Sphere> ball = SphereOf(*walls_[i]);
    for (size_t j = 0; j < i; ++j) {
      const auto* const other = dynamic_cast<const Plane*>(walls_[j].get());
      if (plane != nullptr && other != nullptr) AddOfParallels(i, *plane, j, *other, &cubes);
      const std::optional<Sphere> another = SphereOf(*walls_[j]);
      if (ball && another) AddOfBalls(i, *ball, j, *another, &cubes);
    }
  }
  AddImpossibleOfBodies(*tree_, &cubes);
  return cubes;
}

void Arrangement::AddImpossibleOfBodies(const Node& node, Cubes* cubes) const {
  for (const NodePtr& part : node.parts) AddImpossibleOfBodies(*part, cubes);
  if (!node.is_body()) return;
  const auto body = Conjunction(node);
  if (!body) return;
  for (size_t i = 0; i < walls_.size(); ++i) {
    const auto* const plane = dynamic_cast<const Plane*>(walls_[i].get());
    if (plane == nullptr) continue;
    const int sign = SignBeyond(*node.hull, *plane);
    if (sign == 0 || body->contains({i, sign < 0})) continue;
    std::vector<Literal> cube(body->begin(), body->end());
    cube.emplace_back(i, sign > 0);
    cubes->push_back(std::move(cube));
  }
}

void LeaveOutIdle(std::vector<WallPtr>* walls, Labelling* labels) {
  for (size_t i = walls->size(); i-- > 0;) {
    Labelling without;
    without.reserve(labels->size() / 2);
    bool idle = true;
    for (size_t code = 0; idle && code < labels->size(); ++code) {
      if (Bit(code, i)) continue;
      const std::int8_t below = (*labels)[code], above = (*labels)[code | size_t{1} << i];
      idle = below == above || below < 0 || above < 0;
      without.push_back(std::max(below, above));
    }
    if (!idle) continue;
    *labels = std::move(without);
    walls->erase(walls->begin() + static_cast<std::ptrdiff_t>(i));
  }
}

}  // namespace stellate::solids
