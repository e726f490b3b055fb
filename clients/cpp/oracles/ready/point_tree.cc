#include "oracles/ready/point_tree.h"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>

namespace stellate::oracles {

struct PointTree::Tree {
  using Index = nanoflann::KDTreeEigenMatrixAdaptor<Eigen::MatrixXd, -1, nanoflann::metric_L2,
                                                    /*row_major=*/false>;
  static constexpr int kLeaf = 10;  // points, nanoflann's own choice

  explicit Tree(const Eigen::MatrixXd& points)
      : index(static_cast<int>(points.rows()), std::cref(points), kLeaf) {}
  Index index;
};

PointTree::PointTree(Eigen::MatrixXd points)
    : points_(std::move(points)), tree_(std::make_unique<const Tree>(points_)) {}

PointTree::~PointTree() = default;

std::vector<Eigen::Index> PointTree::Nearest(const Eigen::VectorXd& x, Eigen::Index count,
                                             std::vector<double>* distances) const {
  count = std::min(count, points_.cols());
  std::vector<Eigen::Index> near(static_cast<size_t>(count));
  std::vector<double> squares(near.size());
  const size_t found =
      tree_->index.index->knnSearch(x.data(), near.size(), near.data(), squares.data());
  near.resize(found);
  squares.resize(found);
  if (distances != nullptr) {
    for (double& square : squares) square = std::sqrt(square);
    *distances = std::move(squares);
  }
  return near;
}

std::vector<Eigen::Index> PointTree::Within(const Eigen::VectorXd& x, double radius) const {
  std::vector<std::pair<Eigen::Index, double>> found;
  nanoflann::SearchParams unsorted;
  unsorted.sorted = false;
  tree_->index.index->radiusSearch(x.data(), radius * radius, found, unsorted);
  std::vector<Eigen::Index> near;
  near.reserve(found.size());
  for (const auto& [number, square] : found) near.push_back(number);
  std::sort(near.begin(), near.end());
  return near;
}

}  // namespace stellate::oracles
