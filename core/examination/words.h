#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <variant>

#include "core/examiner.h"

namespace stellate::core::examination {

// One value of a finding's sentence: a number, a point or words.
struct Value {
  Value(const char* its_name, double number) : name(its_name), value(number) {}
  Value(const char* its_name, int number) : name(its_name), value(std::int64_t{number}) {}
  Value(const char* its_name, Eigen::Index number) : name(its_name), value(std::int64_t{number}) {}
  Value(const char* its_name, Eigen::VectorXd point) : name(its_name), value(std::move(point)) {}
  Value(const char* its_name, std::string words) : name(its_name), value(std::move(words)) {}

  std::string name;
  std::variant<double, std::int64_t, Eigen::VectorXd, std::string> value;
};

// Writes a value as it stands in a sentence: four digits, thousands set off, six coordinates.
std::string Show(const Value& value);

// Returns the finding of that code, its sentences completed. Throws std::logic_error for an unknown
// code. Its place is the value "query", else "answer".
Finding MakeFinding(const std::string& code, std::initializer_list<Value> values);

// A finding that leaves nothing to go on with; thrown.
struct Stop {
  Finding finding;
};

// Returns `length` to two digits.
double ToTwoDigits(double length);

}  // namespace stellate::core::examination
