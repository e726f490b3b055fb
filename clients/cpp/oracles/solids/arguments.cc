#include "oracles/solids/arguments.h"

#include <algorithm>
#include <utility>

namespace stellate::solids {
namespace {

using Eigen::VectorXd;

constexpr Eigen::Index kSpace = 3;

}  // namespace

std::string Quoted(std::string_view text) { return std::string("'").append(text).append("'"); }

double Arguments::Number(const std::string& name, std::optional<double> otherwise) {
  const std::optional<Argument> given = Take(name);
  if (!given && !otherwise) Lacks(name, "a number");
  if (!given) return *otherwise;
  if (const auto* const number = std::get_if<double>(&given->value)) return *number;
  Refuse(*given, name, "a number");
}

std::optional<double> Arguments::NumberIfAny(const std::string& name) {
  const std::optional<Argument> given = Take(name);
  if (!given) return std::nullopt;
  if (const auto* const number = std::get_if<double>(&given->value)) return *number;
  Refuse(*given, name, "a number");
}

VectorXd Arguments::Point(const std::string& name, bool everywhere) {
  const std::optional<Argument> given = Take(name);
  const std::string what = everywhere ? "a number or a point, (1, 2, 3)" : "a point, (1, 2, 3)";
  if (!given) Lacks(name, what);
  if (const auto* const point = std::get_if<VectorXd>(&given->value)) return *point;
  const auto* const number = std::get_if<double>(&given->value);
  if (everywhere && number != nullptr) return VectorXd::Constant(kSpace, *number);
  Refuse(*given, name, what);
}

VectorXd Arguments::PointOrOrigin(const std::string& name) {
  return IsGiven(name) || NextByPlace() ? Point(name) : VectorXd(VectorXd::Zero(kSpace));
}

Eigen::Vector3d Arguments::PointOfSpace(const std::string& name) {
  return InSpace(name, Point(name));
}

Eigen::Vector3d Arguments::Axis() {
  std::optional<Argument> given;
  const auto first = NextByPlace();
  if (IsGiven("axis") || (first && !std::holds_alternative<double>(given_[*first].value))) {
    given = Take("axis");
  }
  if (!given) return Eigen::Vector3d::UnitZ();
  if (const auto* const vector = std::get_if<VectorXd>(&given->value)) {
    if (vector->size() == kSpace) return *vector;
  } else if (const auto* const word = std::get_if<std::string>(&given->value)) {
    if (*word == "x") return Eigen::Vector3d::UnitX();
    if (*word == "y") return Eigen::Vector3d::UnitY();
    if (*word == "z") return Eigen::Vector3d::UnitZ();
  }
  Refuse(*given, "axis", "x, y, z or a vector of space, (1, 2, 3)");
}

Eigen::Vector3d Arguments::Place() {
  return IsGiven("at") ? InSpace("at", Point("at")) : Eigen::Vector3d::Zero();
}

Solid Arguments::Part(const std::string& name) {
  const std::optional<Argument> given = Take(name);
  if (!given) Lacks(name, "a solid");
  if (const auto* const solid = std::get_if<Solid>(&given->value)) return *solid;
  Refuse(*given, name, "a solid");
}

Join Arguments::HowJoined() {
  const std::optional<Argument> given = Take("join");
  if (!given) return Join::kUnion;
  if (const auto* const word = std::get_if<std::string>(&given->value)) {
    if (*word == "union") return Join::kUnion;
    if (*word == "intersection") return Join::kIntersection;
    if (*word == "difference") return Join::kDifference;
  }
  Refuse(*given, "join", "union, intersection or difference");
}

void Arguments::Finish() const {
  if (given_.empty()) return;
  const Argument& extra = given_.front();
  throw ExpressionError(extra.column, call_ + " takes no " +
                                          (extra.name.empty() ? "further argument " + extra.text
                                                              : "argument " + extra.name));
}

bool Arguments::IsGiven(const std::string& name) const {
  return std::any_of(given_.begin(), given_.end(),
                     [&](const Argument& a) { return a.name == name; });
}

std::optional<size_t> Arguments::NextByPlace() const {
  for (size_t i = 0; i < given_.size(); ++i) {
    if (given_[i].name.empty()) return i;
  }
  return std::nullopt;
}

std::optional<Argument> Arguments::Take(const std::string& name) {
  std::optional<size_t> at = NextByPlace();
  for (size_t i = 0; i < given_.size(); ++i) {
    if (!name.empty() && given_[i].name == name) at = i;
  }
  if (!at) return std::nullopt;
  Argument taken = given_[*at];
  given_.erase(given_.begin() + static_cast<std::ptrdiff_t>(*at));
  return taken;
}

Eigen::Vector3d Arguments::InSpace(const std::string& name, const VectorXd& point) const {
  if (point.size() == kSpace) return point;
  throw ExpressionError(column_, call_ + " is of space: its " + name + " has 3 numbers, not " +
                                     std::to_string(point.size()));
}

void Arguments::Lacks(const std::string& name, const std::string& what) const {
  throw ExpressionError(column_, call_ + " lacks its " + name + ", " + what);
}

void Arguments::Refuse(const Argument& given, const std::string& name,
                       const std::string& what) const {
  throw ExpressionError(given.column, "the " + name + " of " + call_ + " has to be " + what +
                                          ", and is " + Quoted(given.text));
}

}  // namespace stellate::solids
