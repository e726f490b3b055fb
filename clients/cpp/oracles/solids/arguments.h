#pragma once

#include <Eigen/Core>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "stellate/solids.h"

namespace stellate::solids {

// What is wrong with an expression, and where.
class ExpressionError : public std::invalid_argument {
 public:
  ExpressionError(int column, const std::string& what)
      : std::invalid_argument(what), column_(column) {}
  int column() const { return column_; }  // from 1 on

 private:
  int column_;
};

// 'text'.
std::string Quoted(std::string_view text);

// An argument: a number, a point, a solid, or a word such as x.
struct Argument {
  std::string name;  // empty: by its place
  int column = 0;
  std::string text;
  std::variant<double, Eigen::VectorXd, Solid, std::string> value;
};

// The arguments of one call, taken by name or, in their order, by place. Each is taken once; what
// is lacking or no value of that kind is refused by an ExpressionError.
//
//   const double radius = arguments.Number("radius", 1);
//   const Eigen::Vector3d at = arguments.Place();
//   arguments.Finish();
class Arguments {
 public:
  Arguments(std::string call, int column, std::vector<Argument> given)
      : call_(std::move(call)), column_(column), given_(std::move(given)) {}

  double Number(const std::string& name, std::optional<double> otherwise = std::nullopt);
  std::optional<double> NumberIfAny(const std::string& name);
  // A number stands for a point of space that has it everywhere.
  Eigen::VectorXd Point(const std::string& name, bool everywhere = false);
  Eigen::VectorXd PointOrOrigin(const std::string& name);
  Eigen::Vector3d PointOfSpace(const std::string& name);
  // x, y, z or a vector, by name or before all else; by default z.
  Eigen::Vector3d Axis();
  // The point `at`, or the origin.
  Eigen::Vector3d Place();
  Solid Part(const std::string& name);
  Join HowJoined();
  // Refuses what was not taken.
  void Finish() const;
  int column() const { return column_; }

 private:
  bool IsGiven(const std::string& name) const;
  std::optional<size_t> NextByPlace() const;
  std::optional<Argument> Take(const std::string& name);
  Eigen::Vector3d InSpace(const std::string& name, const Eigen::VectorXd& point) const;
  [[noreturn]] void Lacks(const std::string& name, const std::string& what) const;
  [[noreturn]] void Refuse(const Argument& given, const std::string& name,
                           const std::string& what) const;

  std::string call_;
  int column_;
  std::vector<Argument> given_;
};

}  // namespace stellate::solids
