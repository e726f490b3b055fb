#pragma once

#include <Eigen/Core>
#include <string>

// Axes of different units, as Python's client has them.
namespace stellate::oracles {

// `scale` has d lengths, or one for all axes. Throws std::invalid_argument.
Eigen::VectorXd UnitsOf(const Eigen::VectorXd& scale, Eigen::Index d);

// What verdicts say. Without parentheses, which places have.
std::string AboutUnits(const Eigen::VectorXd& units);

}  // namespace stellate::oracles
