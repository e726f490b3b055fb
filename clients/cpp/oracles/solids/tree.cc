#include "oracles/solids/tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace stellate::solids {
namespace {

using Eigen::VectorXd;
using Kind = Node::Kind;

constexpr double kEndless = std::numeric_limits<double>::infinity();

void AddWalls(const Node& node, std::vector<WallPtr>* walls) {
  if (node.kind == Kind::kHalf) walls->push_back(node.wall);
  for (const NodePtr& part : node.parts) AddWalls(*part, walls);
}

// The complement of a node, by de Morgan's laws.
NodePtr PushedIn(const Node& node) {
  if (node.kind == Kind::kNot) return node.parts.front();
  if (node.kind == Kind::kHalf) {
    if (const auto* const plane = dynamic_cast<const Plane*>(node.wall.get())) {
      return Half(std::make_shared<Plane>(-plane->normal(), -plane->level()));
    }
    return All({});  // which is not known to end anywhere
  }
  std::vector<NodePtr> parts;
  parts.reserve(node.parts.size());
  for (const NodePtr& part : node.parts) parts.push_back(Not(part));
  return node.kind == Kind::kAll ? Either(std::move(parts)) : All(std::move(parts));
}

double SupportOfHalf(const Node& node, const VectorXd& direction) {
  const auto* const plane = dynamic_cast<const Plane*>(node.wall.get());
  if (plane == nullptr) return kEndless;
  const double away = direction.dot(plane->normal()), size = direction.norm();
  const bool against = (direction + size * plane->normal()).norm() <= kRounding * size && away < 0;
  return against ? -size * plane->level() : kEndless;
}

// The parts of an intersection, and those of intersections among them that have no hull.
void Flatten(const Node& node, std::vector<NodePtr>* parts) {
  for (const NodePtr& part : node.parts) {
    if (part->kind == Kind::kAll && !part->is_body()) {
      Flatten(*part, parts);
    } else {
      parts->push_back(part);
    }
  }
}

bool IsTrivial(const Node& node, Kind kind) { return node.kind == kind && node.parts.empty(); }

// Without parts that are nothing, or all of space.
NodePtr Short(Kind kind, std::vector<NodePtr> parts) {
  const Kind opposite = kind == Kind::kAll ? Kind::kEither : Kind::kAll;
  const auto make = [](Kind of, std::vector<NodePtr> some) {
    return of == Kind::kAll ? All(std::move(some)) : Either(std::move(some));
  };
  for (const NodePtr& part : parts) {
    if (IsTrivial(*part, opposite)) return make(opposite, {});
  }
  std::erase_if(parts, [kind](const NodePtr& part) { return IsTrivial(*part, kind); });
  return make(kind, std::move(parts));
}

NodePtr SimplifiedWithin(const NodePtr& node, const std::vector<NodePtr>& bodies);

std::vector<NodePtr> EachSimplified(const std::vector<NodePtr>& parts,
                                    const std::vector<NodePtr>& bodies) {
  std::vector<NodePtr> simplified;
  simplified.reserve(parts.size());
  for (const NodePtr& part : parts) simplified.push_back(SimplifiedWithin(part, bodies));
  return simplified;
}

NodePtr SimplifiedHalf(const NodePtr& node, const std::vector<NodePtr>& bodies) {
  const auto* const plane = dynamic_cast<const Plane*>(node->wall.get());
  if (plane == nullptr) return node;
  for (const NodePtr& body : bodies) {
    const int sign = SignBeyond(*body->hull, *plane);
    if (sign != 0) return sign > 0 ? Either({}) : All({});
  }
  return node;
}

NodePtr SimplifiedNot(const NodePtr& node, const std::vector<NodePtr>& bodies) {
  const NodePtr& of = node->parts.front();
  NodePtr inner = SimplifiedWithin(of, bodies);
  if (inner == of) return node;
  if (IsTrivial(*inner, Kind::kAll)) return Either({});
  if (IsTrivial(*inner, Kind::kEither)) return All({});
  return Not(std::move(inner));
}

NodePtr SimplifiedAll(const NodePtr& node, const std::vector<NodePtr>& bodies) {
  if (node->is_body()) {
    std::vector<NodePtr> kept = EachSimplified(node->parts, bodies);
    // What is left is that body no longer, except where it is intersected with the others.
    return kept == node->parts ? node : Short(Kind::kAll, std::move(kept));
  }
  std::vector<NodePtr> own, parts;
  Flatten(*node, &own);
  for (size_t number = 0; number < own.size(); ++number) {
    // A body may go by later ones alone: two that are the same must not both be left out.
    const size_t first = own[number]->is_body() ? number + 1 : 0;
    std::vector<NodePtr> around = bodies;
    std::copy_if(own.begin() + static_cast<std::ptrdiff_t>(first), own.end(),
                 std::back_inserter(around), [](const NodePtr& part) { return part->is_body(); });
    parts.push_back(SimplifiedWithin(own[number], around));
  }
  return Short(Kind::kAll, std::move(parts));
}

// Within the intersection with these bodies.
NodePtr SimplifiedWithin(const NodePtr& node, const std::vector<NodePtr>& bodies) {
  switch (node->kind) {
    case Kind::kHalf:
      return SimplifiedHalf(node, bodies);
    case Kind::kNot:
      return SimplifiedNot(node, bodies);
    case Kind::kEither:
      return Short(Kind::kEither, EachSimplified(node->parts, bodies));
    case Kind::kAll:
      break;
  }
  return SimplifiedAll(node, bodies);
}

}  // namespace

NodePtr Half(WallPtr wall) {
  return std::make_shared<Node>(Node{Kind::kHalf, std::move(wall), {}, nullptr});
}
NodePtr Not(NodePtr of) {
  return std::make_shared<Node>(Node{Kind::kNot, nullptr, {std::move(of)}, nullptr});
}
NodePtr All(std::vector<NodePtr> parts, BodyPtr hull) {
  return std::make_shared<Node>(Node{Kind::kAll, nullptr, std::move(parts), std::move(hull)});
}
NodePtr Either(std::vector<NodePtr> parts) {
  return std::make_shared<Node>(Node{Kind::kEither, nullptr, std::move(parts), nullptr});
}

NodePtr Moved(const NodePtr& node, const Motion& motion) {
  Node moved{node->kind, node->wall == nullptr ? nullptr : node->wall->Moved(motion), {}, nullptr};
  for (const NodePtr& part : node->parts) moved.parts.push_back(Moved(part, motion));
  if (node->hull != nullptr) moved.hull = node->hull->Moved(motion);
  return std::make_shared<Node>(std::move(moved));
}

std::vector<WallPtr> WallsOf(const Node& node) {
  std::vector<WallPtr> walls;
  AddWalls(node, &walls);
  return walls;
}

double Support(const Node& node, const VectorXd& direction) {
  switch (node.kind) {
    case Kind::kHalf:
      return SupportOfHalf(node, direction);
    case Kind::kNot:
      return Support(*PushedIn(*node.parts.front()), direction);
    case Kind::kEither: {
      double most = -kEndless;
      for (const NodePtr& part : node.parts) most = std::max(most, Support(*part, direction));
      return most;
    }
    case Kind::kAll:
      break;
  }
  double least = node.hull == nullptr ? kEndless : node.hull->Support(direction);
  for (const NodePtr& part : node.parts) least = std::min(least, Support(*part, direction));
  return least;
}

NodePtr Simplified(const NodePtr& node) { return SimplifiedWithin(node, {}); }

int SignBeyond(const Body& hull, const Plane& plane) {
  const double size = kRounding * std::max(1.0, std::abs(plane.level()));
  if (-hull.Support(-plane.normal()) >= plane.level() - size) return -1;
  return hull.Support(plane.normal()) <= plane.level() + size ? 1 : 0;
}

}  // namespace stellate::solids
