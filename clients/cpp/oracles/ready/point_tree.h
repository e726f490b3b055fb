#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

namespace stellate::oracles {

// Finds points near a place. Safe to use from several threads.
class PointTree {
 public:
  explicit PointTree(Eigen::MatrixXd points);  // d x n, finite, n > 0
  ~PointTree();

  const Eigen::MatrixXd& points() const { return points_; }
  // The nearest, at most `count` of them, by ascending distance; the distances if asked for.
  std::vector<Eigen::Index> Nearest(const Eigen::VectorXd& x, Eigen::Index count,
                                    std::vector<double>* distances = nullptr) const;
  // Those no farther than the radius, by ascending number.
  std::vector<Eigen::Index> Within(const Eigen::VectorXd& x, double radius) const;

 private:
  struct Tree;

  Eigen::MatrixXd points_;
  std::unique_ptr<const Tree> tree_;
};

}  // namespace stellate::oracles
