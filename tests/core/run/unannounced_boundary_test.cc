// Manifolds that end, served as if they were closed: whatever refuses them says that walls declare
// a boundary.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "core/mesher.h"

namespace stellate::core {
namespace {

using Eigen::Vector3d;

// A surface in R^3 with an edge: its closest points, and its normals.
struct Piece {
  std::string name;
  std::function<Vector3d(Vector3d)> closest, normal;
};
void PrintTo(const Piece& p, std::ostream* out) { *out << p.name; }

Vector3d OnCircle(const Vector3d& x, double radius, double z) {
  const double length = std::hypot(x[0], x[1]);
  return {radius * x[0] / length, radius * x[1] / length, z};
}

// The unit sphere above a height.
Piece Cap(const std::string& name, double height) {
  const auto closest = [height](const Vector3d& x) -> Vector3d {
    const Vector3d y = x.normalized();
    return y[2] >= height ? y : OnCircle(x, std::sqrt(1 - height * height), height);
  };
  return {name, closest, [](const Vector3d& y) { return y; }};
}

Piece Tube() {
  return {"tube", [](const Vector3d& x) { return OnCircle(x, 1, std::clamp(x[2], -1.0, 1.0)); },
          [](const Vector3d& y) { return Vector3d(y[0], y[1], 0); }};
}

Piece FlatRing() {
  return {"ring",
          [](const Vector3d& x) {
            return OnCircle(x, std::clamp(std::hypot(x[0], x[1]), 0.4, 1.0), 0);
          },
          [](const Vector3d&) { return Vector3d::UnitZ(); }};
}

Piece Square() {
  return {"square",
          [](const Vector3d& x) {
            return Vector3d(std::clamp(x[0], -1.0, 1.0), std::clamp(x[1], -1.0, 1.0), 0);
          },
          [](const Vector3d&) { return Vector3d::UnitZ(); }};
}

AnswerBlock AnswerOf(const Piece& piece, const QueryBlock& block) {
  AnswerBlock answer;
  answer.points = block.points;
  if (block.want.tangents) answer.tangents.resize(6, block.size());
  for (Eigen::Index j = 0; j < block.size(); ++j) {
    const Vector3d y = piece.closest(block.points.col(j));
    answer.points.col(j) = y;
    if (!block.want.tangents) continue;
    const Vector3d normal = piece.normal(y).normalized();
    const Eigen::Matrix3d q = Eigen::HouseholderQR<Vector3d>(normal).householderQ();
    for (int i = 0; i < 3; ++i)
      for (int a = 0; a < 2; ++a) answer.tangents(i * 2 + a, j) = q(i, a + 1);
  }
  return answer;
}

class UnannouncedBoundary : public ::testing::TestWithParam<Piece> {};

TEST_P(UnannouncedBoundary, IsRefusedWithTheAdviceToDeclareIt) {
  for (const double epsilon : {0.5, 0.25, 0.12})
    for (const bool tangents : {true, false})
      for (const std::uint64_t seed : {1, 2, 3}) {
        SCOPED_TRACE(::testing::Message() << "epsilon " << epsilon << ", tangents " << tangents);
        Specification spec;
        spec.dimension = 2;
        spec.ambient_dimension = 3;
        spec.epsilon = epsilon;
        spec.oracle.tangent_basis = tangents;
        spec.random_seed = seed;
        spec.limits.max_vertices = 3000;
        spec.bounding_box =
            BoundingBox{Eigen::VectorXd::Constant(3, -1.3), Eigen::VectorXd::Constant(3, 1.3)};
        auto mesher = Mesher::Create(spec);
        ASSERT_TRUE(mesher);
        while (const auto batch = (*mesher)->NextBatch()) {
          Answers answers;
          for (const QueryBlock& block : batch->blocks)
            answers.blocks.push_back(AnswerOf(GetParam(), block));
          ASSERT_TRUE((*mesher)->Absorb(answers));
        }
        const Certificate& c = (*mesher)->report().certificate;
        EXPECT_FALSE(c.certified) << c.verdict;
        EXPECT_NE(c.verdict.find("declared by walls"), std::string::npos)
            << TerminationName((*mesher)->report().termination) << ": " << c.verdict;
      }
}

INSTANTIATE_TEST_SUITE_P(Pieces, UnannouncedBoundary,
                         ::testing::Values(Cap("hemisphere", 0), Cap("most of a sphere", -0.6),
                                           Tube(), FlatRing(), Square()));

}  // namespace
}  // namespace stellate::core
