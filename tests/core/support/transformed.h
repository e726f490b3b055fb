#pragma once

#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "stellate/oracle.h"

namespace stellate::core::testing {

// y = scale * turn * x + shift, turn orthogonal d x d.
struct Motion {
  double scale = 1;
  Eigen::MatrixXd turn;
  Eigen::VectorXd shift;

  static Motion None(int d) {
    return {1, Eigen::MatrixXd::Identity(d, d), Eigen::VectorXd::Zero(d)};
  }
};

inline Eigen::MatrixXd RandomTurn(int d, Random& random) {
  Eigen::MatrixXd entries(d, d);
  for (Eigen::Index i = 0; i < entries.size(); ++i) entries.data()[i] = random.NearlyNormal();
  return Eigen::HouseholderQR<Eigen::MatrixXd>(entries).householderQ();
}

// Axes exchanged and turned round: products with it round nothing.
inline Eigen::MatrixXd RandomSignedPermutation(int d, Random& random, bool permute) {
  std::vector<int> axes(static_cast<std::size_t>(d));
  std::iota(axes.begin(), axes.end(), 0);
  for (int i = d - 1; permute && i > 0; --i)
    std::swap(axes[static_cast<std::size_t>(i)],
              axes[static_cast<std::size_t>(random.Uniform() * (i + 1))]);
  Eigen::MatrixXd turn = Eigen::MatrixXd::Zero(d, d);
  for (int i = 0; i < d; ++i)
    turn(i, axes[static_cast<std::size_t>(i)]) = random.Uniform() < 0.5 ? -1 : 1;
  return turn;
}

// A manifold moved, seen through an oracle that does the motion in floating point. Answers do not
// depend on the rest of the batch.
class Transformed final : public Oracle {
 public:
  Transformed(Oracle& inner, Motion motion) : inner_(inner), motion_(std::move(motion)) {}

  int dimension() const override { return inner_.dimension(); }
  int ambient_dimension() const override { return inner_.ambient_dimension(); }
  bool has_intersect_flat() const override { return inner_.has_intersect_flat(); }
  bool has_tangent_basis() const override { return inner_.has_tangent_basis(); }
  bool has_local_size() const override { return inner_.has_local_size(); }

  Answer ClosestPoint(const Eigen::MatrixXd& x) override { return Out(inner_.ClosestPoint(In(x))); }
  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override {
    return Out(inner_.IntersectFlat(In(centers), Turned(bases, motion_.turn.transpose()),
                                    radii / motion_.scale));
  }
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override {
    return Turned(inner_.TangentBasis(In(points)), motion_.turn);
  }
  Eigen::VectorXd LocalSize(const Eigen::MatrixXd& points) override {
    return motion_.scale * inner_.LocalSize(In(points));
  }
  std::optional<stellate::BoundingBox> bounding_box() const override {
    const auto box = *inner_.bounding_box();
    const Eigen::VectorXd centre = Moved((box.lower + box.upper) / 2);
    const Eigen::VectorXd half =
        motion_.scale * motion_.turn.cwiseAbs() * ((box.upper - box.lower) / 2);
    return stellate::BoundingBox{centre - half, centre + half};
  }

  double LengthUnit() const { return motion_.scale; }
  Eigen::MatrixXd Moved(const Eigen::MatrixXd& x) const {
    return (motion_.scale * EachTimes(motion_.turn, x)).colwise() + motion_.shift;
  }

 private:
  // Column by column: a product of matrices would round by the column's place.
  static Eigen::MatrixXd EachTimes(const Eigen::MatrixXd& factor, const Eigen::MatrixXd& x) {
    Eigen::MatrixXd product(factor.rows(), x.cols());
    for (Eigen::Index j = 0; j < x.cols(); ++j)
      for (Eigen::Index i = 0; i < factor.rows(); ++i) {
        double sum = 0;
        for (Eigen::Index l = 0; l < factor.cols(); ++l) sum += factor(i, l) * x(l, j);
        product(i, j) = sum;
      }
    return product;
  }
  Eigen::MatrixXd In(const Eigen::MatrixXd& y) const {
    return EachTimes(motion_.turn.transpose(), (y.colwise() - motion_.shift) / motion_.scale);
  }
  Answer Out(Answer answer) const {
    answer.points = Moved(answer.points);
    return answer;
  }
  Eigen::MatrixXd Turned(const Eigen::MatrixXd& bases, const Eigen::MatrixXd& turn) const {
    const Eigen::Index d = turn.rows(), k = inner_.dimension();
    Eigen::MatrixXd turned(bases.rows(), bases.cols());
    for (Eigen::Index j = 0; j < bases.cols(); ++j)
      for (Eigen::Index i = 0; i < d; ++i)
        for (Eigen::Index a = 0; a < k; ++a) {
          double sum = 0;
          for (Eigen::Index l = 0; l < d; ++l) sum += turn(i, l) * bases(l * k + a, j);
          turned(i * k + a, j) = sum;
        }
    return turned;
  }

  Oracle& inner_;
  Motion motion_;
};

}  // namespace stellate::core::testing
