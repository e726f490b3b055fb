#pragma once

#include <Eigen/Core>
#include <initializer_list>
#include <string>
#include <utility>

#include "stellate/doctor.h"

namespace stellate::doctor {

// A number, a point or a word, as it stands in a sentence.
std::string Show(double value);
std::string Show(std::int64_t value);
inline std::string Show(int value) { return Show(static_cast<std::int64_t>(value)); }
std::string Show(const Eigen::VectorXd& point);
inline std::string Show(const std::string& word) { return word; }

// One value of a finding's sentence.
struct Value {
  template <typename T>
  Value(const char* its_name, const T& value) : name(its_name), shown(Show(value)) {}
  std::string name, shown;
};

// The finding of that code, its sentences completed. Throws std::logic_error for an unknown code.
Finding MakeFinding(const std::string& code, std::initializer_list<Value> values);

// Generated from findings.txt.
extern const char* const kFindingsText;

}  // namespace stellate::doctor
