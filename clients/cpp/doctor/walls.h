#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "doctor/findings.h"
#include "doctor/probe.h"

namespace stellate::doctor {

// The walls of an oracle under examination; what breaks a law is given to `add`.
class WallProbe {
 public:
  WallProbe(Probe& probe, std::function<void(Finding)> add);

  void Examine();
  // Of the boundary, by Federer's quotient on each wall.
  double Reach();

 private:
  using Vector = Eigen::VectorXd;

  void Add(const std::string& code, std::initializer_list<Value> values) {
    add_(MakeFinding(code, values));
  }
  // The laws of one wall at points of its face; gives those of them that lie in M.
  Eigen::MatrixXd One(int wall, const Eigen::MatrixXd& found);
  Eigen::MatrixXd OnManifold(int wall, const Eigen::MatrixXd& found);
  // Bisects between samples on both sides of each wall that has no known point.
  bool Crosses(int wall);
  // How the wall's value changes along M, k x n.
  Eigen::MatrixXd Slopes(int wall, const Eigen::MatrixXd& y, const std::vector<Basis>& bases);
  void Conormal(int wall, const Vector& y, const Basis& basis, const Vector& n,
                const Vector& slope);
  // From near a point of the face that, or a nearer one, is the nearest.
  void Closest(int wall, const Eigen::MatrixXd& y);
  // The laws of two walls where they meet inside the others.
  void Two(int wall, int other, const Eigen::MatrixXd& found);
  void AnythingLeft();

  Probe& probe_;
  const std::function<void(Finding)> add_;
  const double slack_;
  std::vector<Eigen::MatrixXd> points_;  // of each wall, those of its face that lie in M
};

}  // namespace stellate::doctor
