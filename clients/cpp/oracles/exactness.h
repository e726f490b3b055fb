#pragma once

#include <Eigen/Core>
#include <functional>
#include <mutex>
#include <string>

#include "stellate/oracle.h"

namespace stellate {

// Insists, once, that a user's function is as exact as double precision is. Safe to use from
// several threads.
class Exactness {
 public:
  using Function = std::function<Eigen::VectorXd(const Eigen::VectorXd& x)>;

  // `name` is the function's, for messages; `box` is of what it takes; `about` (d x s) are places
  // to look from: without any, random ones of the box.
  Exactness(std::string name, BoundingBox box, Eigen::MatrixXd about = {});

  // Throws OracleError where f rounds to single precision and back, or is as noisy.
  void Insist(const Function& f) const;

 private:
  std::string Judge(const Function& f) const;

  std::string name_;
  BoundingBox box_;
  Eigen::MatrixXd about_;
  mutable std::once_flag once_;
  mutable std::string fault_;  // empty: none
};

}  // namespace stellate
