#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <string>

#include "core/base/message.h"

namespace stellate::core {

// Writes the first six coordinates of a point, as messages name it.
//
//   NamePoint(Eigen::Vector2d(0.5, 1));  // "(0.5, 1)"
inline std::string NamePoint(const Eigen::VectorXd& x) {
  std::string name = "(";
  for (Eigen::Index i = 0; i < std::min<Eigen::Index>(x.size(), 6); ++i) {
    name += Message(i > 0 ? ", " : "", Brief(x[i]));
  }
  return name + (x.size() > 6 ? ", ...)" : ")");
}

}  // namespace stellate::core
