#include "core/certificate/evidence/undeclared_boundary_check.h"

#include <gtest/gtest.h>

#include <cmath>

namespace stellate::core {
namespace {

using Eigen::Vector3d;

// The plane z = 0 without the disc of this radius around the origin.
Vector3d Punctured(const Vector3d& x, double hole) {
  const double out = std::hypot(x[0], x[1]);
  return (out < hole ? hole / out : 1) * Vector3d(x[0], x[1], 0);
}

std::string Told(UndeclaredBoundaryCheck& check, double hole, double position_error = 0) {
  const Eigen::MatrixXd questions = check.Questions(position_error);
  AnswerBlock answer;
  answer.points.resize(3, questions.cols());
  for (Eigen::Index j = 0; j < questions.cols(); ++j)
    answer.points.col(j) = Punctured(questions.col(j), hole);
  return check.Judge(answer, position_error);
}

void Mark(UndeclaredBoundaryCheck& check, const Vector3d& q, const Vector3d& y) {
  const Vector3d step = q - y;
  check.Add(y, Vector3d(step[0], step[1], 0), step.norm());
}

TEST(UndeclaredBoundaryCheck, FindsTheBoundaryOfAHoleOfAnySize) {
  for (const double hole : {0.5, 0.05, 1e-6}) {
    UndeclaredBoundaryCheck check(1);
    const Vector3d q(0.3 * hole, 0.2 * hole, 0.5 * hole);
    Mark(check, q, Punctured(q, hole));
    EXPECT_NE(Told(check, hole).find("the manifold ends"), std::string::npos) << hole;
  }
}

TEST(UndeclaredBoundaryCheck, TakesNoPoorTangentForABoundary) {
  UndeclaredBoundaryCheck check(1);
  Mark(check, {0.7, 0, 0.2}, {0.6, 0, 0});  // as if the answer were to the side by mistake
  EXPECT_EQ(Told(check, 0.1), "");
  // As if the tangent space were wrong by 80 degrees: neither step is along the plane.
  const Vector3d up(std::cos(1.4), 0, std::sin(1.4));
  check.Add(Vector3d(0.6, 0, 0), 0.1 * up, 0.1);
  EXPECT_EQ(Told(check, 0.1), "");
}

TEST(UndeclaredBoundaryCheck, AsksOnlyAboutOffsetsAboveTheErrorOfAnswers) {
  UndeclaredBoundaryCheck check(1);
  Mark(check, {1.01, 0, 0.1}, {1, 0, 0});
  EXPECT_EQ(check.Questions(0).cols(), 0);
  Mark(check, {0.999, 0, 0.001}, {1, 0, 0});
  EXPECT_EQ(check.Questions(1e-3).cols(), 0);
  for (int i = 0; i < 1000; ++i) Mark(check, {0.5, 0, 0.1}, {1, 0, 0});
  EXPECT_EQ(check.Questions(1e-3).cols(), 2 * 32);
}

}  // namespace
}  // namespace stellate::core
