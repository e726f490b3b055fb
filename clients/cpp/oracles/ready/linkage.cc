#include <algorithm>
#include <limits>

#include "oracles/combined/common.h"
#include "stellate/oracles/equations.h"

namespace stellate::oracles {
namespace {

using Places = Linkage::Places;

// One end of a bar: a joint that moves, by its number, or where a fixed one is.
struct End {
  Eigen::Index moving = -1;
  Eigen::VectorXd place;

  Eigen::VectorXd At(const Eigen::VectorXd& x, Eigen::Index space) const {
    return moving < 0 ? place : Eigen::VectorXd(x.segment(moving * space, space));
  }
};

struct Rod {
  End a, b;
  double length;
};

Eigen::Index SpaceOf(const Places& fixed) {
  if (fixed.empty()) Refuse("a linkage needs bars, and one joint at least that is fixed");
  const Eigen::Index space = fixed.begin()->second.size();
  const bool same = std::all_of(fixed.begin(), fixed.end(), [space](const auto& joint) {
    return joint.second.size() == space && joint.second.allFinite();
  });
  if (!same || (space != 2 && space != 3)) {
    Refuse("fixed joints have to lie all in the plane, or all in space");
  }
  return space;
}

std::vector<std::string> MovingOf(const std::vector<Bar>& bars, const Places& fixed) {
  std::vector<std::string> moving;
  for (const Bar& bar : bars) {
    if (bar.a == bar.b || !std::isfinite(bar.length) || bar.length <= 0) {
      Refuse("a bar (" + bar.a + ", " + bar.b + ", " + Short(bar.length) +
             "): two joints, length > 0");
    }
    for (const std::string& joint : {bar.a, bar.b}) {
      if (!fixed.contains(joint) &&
          std::find(moving.begin(), moving.end(), joint) == moving.end()) {
        moving.push_back(joint);
      }
    }
    if (fixed.contains(bar.a) && fixed.contains(bar.b)) {
      Refuse("the bar (" + bar.a + ", " + bar.b + ") joins two joints that are fixed");
    }
  }
  return moving;
}

void InsistOnBarsAt(const std::vector<Bar>& bars, const Places& fixed) {
  for (const auto& [joint, place] : fixed) {
    const bool held = std::any_of(bars.begin(), bars.end(), [&name = joint](const Bar& bar) {
      return bar.a == name || bar.b == name;
    });
    if (!held) {
      Refuse("no bar has the fixed joint " + joint +
             " at an end. Is it a slip of the pen? Else leave it out");
    }
  }
}

// As far as bars reach from the fixed joints, by shortest chains.
BoundingBox BoxOf(const std::vector<Bar>& bars, const Places& fixed,
                  const std::vector<std::string>& moving, Eigen::Index space) {
  const double infinite = std::numeric_limits<double>::infinity();
  Places lower = fixed, upper = fixed;
  const auto reach = [&](const std::string& one, const std::string& other, double length) {
    if (!lower.contains(one) || fixed.contains(other)) return;
    lower.try_emplace(other, Eigen::VectorXd::Constant(space, -infinite));
    upper.try_emplace(other, Eigen::VectorXd::Constant(space, infinite));
    const Eigen::VectorXd low = lower[one].array() - length, high = upper[one].array() + length;
    lower[other] = lower[other].cwiseMax(low);
    upper[other] = upper[other].cwiseMin(high);
  };
  for (size_t round = 0; round <= moving.size(); ++round) {
    for (const Bar& bar : bars) {
      reach(bar.a, bar.b, bar.length);
      reach(bar.b, bar.a, bar.length);
    }
  }
  BoundingBox box{Eigen::VectorXd(space * std::ssize(moving)),
                  Eigen::VectorXd(space * std::ssize(moving))};
  for (Eigen::Index i = 0; i < std::ssize(moving); ++i) {
    const std::string& joint = moving[static_cast<size_t>(i)];
    if (!lower.contains(joint)) Refuse("no chain of bars leads from a fixed joint to " + joint);
    box.lower.segment(i * space, space) = lower[joint];
    box.upper.segment(i * space, space) = upper[joint];
  }
  if (!(box.lower.array() < box.upper.array()).all()) {
    Refuse("the bars are too short to reach each other");
  }
  return box;
}

}  // namespace

struct Linkage::Plan {
  Plan(const std::vector<Bar>& bars, const Places& fixed_joints)
      : fixed(fixed_joints), space(SpaceOf(fixed)), moving(MovingOf(bars, fixed)) {
    if (bars.empty()) Refuse("a linkage needs bars, and one joint at least that is fixed");
    const Eigen::Index d = space * std::ssize(moving);
    if (d - std::ssize(bars) < 1) {
      Refuse(std::to_string(moving.size()) + " joints in R^" + std::to_string(space) + " have " +
             std::to_string(d) + " coordinates; " + std::to_string(bars.size()) +
             " bars leave nothing to move");
    }
    box = BoxOf(bars, fixed, moving, space);
    InsistOnBarsAt(bars, fixed);
    for (const Bar& bar : bars) rods.push_back({EndOf(bar.a), EndOf(bar.b), bar.length});
  }

  End EndOf(const std::string& joint) const {
    if (fixed.contains(joint)) return {-1, fixed.at(joint)};
    return {std::find(moving.begin(), moving.end(), joint) - moving.begin(), {}};
  }

  // By how much squared distances are too large, over twice the length: about lengths.
  Function Excess() const {
    return [rods = rods, space = space](const Eigen::VectorXd& x) {
      Eigen::VectorXd excess(std::ssize(rods));
      for (Eigen::Index i = 0; i < excess.size(); ++i) {
        const Rod& rod = rods[static_cast<size_t>(i)];
        const double squared = (rod.a.At(x, space) - rod.b.At(x, space)).squaredNorm();
        excess[i] = (squared - rod.length * rod.length) / (2 * rod.length);
      }
      return excess;
    };
  }

  Jacobian Slopes() const {
    return [rods = rods, space = space](const Eigen::VectorXd& x) {
      Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(std::ssize(rods), x.size());
      for (Eigen::Index i = 0; i < slopes.rows(); ++i) {
        const Rod& rod = rods[static_cast<size_t>(i)];
        const Eigen::VectorXd away = (rod.a.At(x, space) - rod.b.At(x, space)) / rod.length;
        if (rod.a.moving >= 0) slopes.row(i).segment(rod.a.moving * space, space) += away;
        if (rod.b.moving >= 0) slopes.row(i).segment(rod.b.moving * space, space) -= away;
      }
      return slopes;
    };
  }

  Places fixed;
  Eigen::Index space;
  std::vector<std::string> moving;
  std::vector<Rod> rods;
  BoundingBox box;
};

Linkage::Linkage(const Plan& plan)
    : ImplicitOracle(static_cast<int>(plan.box.lower.size() - std::ssize(plan.rods)),
                     static_cast<int>(plan.box.lower.size()), plan.Excess(), plan.Slopes(),
                     plan.box),
      moving_(plan.moving),
      fixed_(plan.fixed) {}

Linkage::Linkage(const std::vector<Bar>& bars, const Places& fixed) : Linkage(Plan(bars, fixed)) {}

std::map<std::string, Eigen::MatrixXd> Linkage::Joints(const Eigen::MatrixXd& points) const {
  if (points.rows() != ambient_dimension()) {
    Refuse("points of this linkage have " + std::to_string(ambient_dimension()) + " coordinates");
  }
  std::map<std::string, Eigen::MatrixXd> joints;
  for (const auto& [name, place] : fixed_) joints[name] = place.replicate(1, points.cols());
  const Eigen::Index space = fixed_.begin()->second.size();
  for (Eigen::Index i = 0; i < std::ssize(moving_); ++i) {
    joints[moving_[static_cast<size_t>(i)]] = points.middleRows(i * space, space);
  }
  return joints;
}

}  // namespace stellate::oracles
