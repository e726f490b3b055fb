#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/batch.h"
#include "core/specification.h"

namespace stellate::server::testing {

// The unit sphere of R^3 as an oracle, in closed form.

inline core::Specification SphereSpec(double epsilon) {
  core::Specification spec;
  spec.dimension = 2;
  spec.ambient_dimension = 3;
  spec.epsilon = epsilon;
  spec.oracle = {true, true};
  spec.bounding_box =
      core::BoundingBox{Eigen::VectorXd::Constant(3, -1.5), Eigen::VectorXd::Constant(3, 1.5)};
  return spec;
}

inline Eigen::Matrix<double, 3, 2> SphereTangents(const Eigen::Vector3d& p) {
  const Eigen::Vector3d u = p.unitOrthogonal();
  Eigen::Matrix<double, 3, 2> basis;
  basis << u, p.normalized().cross(u);
  return basis;
}

// Answers queries [first, first + count) of a block.
inline core::AnswerBlock AnswerSphere(const core::QueryBlock& block, Eigen::Index first,
                                      Eigen::Index count) {
  core::AnswerBlock answer;
  answer.points.resize(3, count);
  answer.found.assign(static_cast<std::size_t>(count), 1);
  if (block.want.tangents) answer.tangents.resize(6, count);
  if (block.want.sizes) answer.sizes.resize(count);
  for (Eigen::Index j = 0; j < count; ++j) {
    const Eigen::Vector3d c = block.points.col(first + j);
    Eigen::Vector3d y = c.normalized();
    if (block.kind == core::QueryKind::kIntersectFlat) {
      // The flat is the line through c along the normal n of T: |c + s n| = 1.
      Eigen::Vector3d u, v;
      for (int i = 0; i < 3; ++i) {
        u[i] = block.bases(2 * i, first + j);
        v[i] = block.bases(2 * i + 1, first + j);
      }
      const Eigen::Vector3d n = u.cross(v);
      const double b = c.dot(n);
      const double root = b * b - c.squaredNorm() + 1;
      const double s =
          b > 0 ? -b + std::sqrt(std::max(root, 0.0)) : -b - std::sqrt(std::max(root, 0.0));
      y = c + s * n;
      const bool found = root >= 0 && std::abs(s) <= block.radii[first + j];
      answer.found[static_cast<std::size_t>(j)] = found ? 1 : 0;
    }
    answer.points.col(j) = y;
    if (block.want.sizes) answer.sizes[j] = 0.4 + 0.2 * (1 + y.z());  // some field
    if (!block.want.tangents) continue;
    const auto basis = SphereTangents(y);
    for (int i = 0; i < 3; ++i) {
      answer.tangents(2 * i, j) = basis(i, 0);
      answer.tangents(2 * i + 1, j) = basis(i, 1);
    }
  }
  return answer;
}

}  // namespace stellate::server::testing
