#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cstdint>
#include <vector>

#include "core/refinement/engine.h"

namespace stellate::core::testing {

// The unit sphere of R^3 without an oracle in between, for classes that are tested by themselves.

inline Specification SphereSpec(double epsilon) {
  Specification spec;
  spec.dimension = 2;
  spec.ambient_dimension = 3;
  spec.epsilon = epsilon;
  spec.oracle.intersect_flat = spec.oracle.tangent_basis = true;
  spec.bounding_box = BoundingBox{Eigen::Vector3d::Constant(-1.1), Eigen::Vector3d::Constant(1.1)};
  return spec;
}

// Points of the sphere nearest to `x`, 3 x n, with tangents by vector; all found.
inline AnsweredPoints OnSphere(const Eigen::MatrixXd& x) {
  AnsweredPoints answers;
  answers.points = x.colwise().normalized();
  answers.tangents.resize(6, x.cols());
  for (Eigen::Index i = 0; i < x.cols(); ++i) {
    const Eigen::Vector3d y = answers.points.col(i);
    const Eigen::Vector3d u = y.unitOrthogonal();
    answers.tangents.col(i) << u, y.cross(u);
  }
  answers.found.assign(static_cast<std::size_t>(x.cols()), 1);
  answers.answered = answers.found;
  return answers;
}

inline AnsweredPoints OnSphere(const CandidateSet<2>& candidates) {
  Eigen::MatrixXd all(3, candidates.size());
  all << candidates.points, candidates.planned.points.reshaped(3, candidates.planned.size());
  return OnSphere(all);
}

// The six vertices of an octahedron.
inline Eigen::MatrixXd Octahedron() {
  Eigen::MatrixXd x(3, 6);
  x << Eigen::Matrix3d::Identity(), -Eigen::Matrix3d::Identity();
  return x;
}

inline Engine<2> EngineOnSphere(const Specification& spec, const Eigen::MatrixXd& seeds) {
  Engine<2> engine(spec, Resolve(spec));
  const AnsweredPoints answers = OnSphere(seeds);
  for (Eigen::Index c = 0; c < seeds.cols(); ++c) engine.Append(answers, c);
  engine.Commit();
  return engine;
}

// One round, numbered for the draw; false once there is nothing to mend.
inline bool StepOnSphere(Engine<2>* engine, std::uint64_t round) {
  auto targets = engine->Plan();
  if (!targets || targets->empty()) return false;
  const CandidateSet<2> candidates = engine->Draw(engine->Select(*targets), round);
  engine->Insert(candidates, OnSphere(candidates));
  engine->Commit();
  return true;
}

}  // namespace stellate::core::testing
