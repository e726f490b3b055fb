#include "core/certificate/evidence/shrinking_balls.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/vector_ops.h"
#include "core/certificate/evidence/evidence.h"
#include "core/certificate/evidence/probes.h"
#include "core/certificate/findings.h"
#include "core/geometry/reach_bound.h"

namespace stellate::core {
namespace {

// A ball is queried at slightly less than the radius found: the centre of the ball that touches M
// twice is on the medial axis, where oracles divide by zero.
constexpr double kInside = 0.98;
constexpr double kMet = 1e-3;  // of the longest edge
// Sine of the least error assumed of the tangent space at a point that is no vertex.
constexpr double kTilt = 0.25;

}  // namespace

Eigen::VectorXd ShrinkingBalls::PointOf(const Ball& ball) const {
  if (ball.point.size() > 0) return ball.point;
  return Eigen::Map<const Eigen::VectorXd>(mesh_.Point(ball.vertex), mesh_.d);
}

Eigen::MatrixXd ShrinkingBalls::TangentsOf(std::uint32_t v) const {
  return Eigen::Map<const Eigen::MatrixXd>(mesh_.Tangent(v), mesh_.d, mesh_.k);
}

// Writes a random direction normal to the tangents; returns false if there is none.
bool ShrinkingBalls::AimAcross(const Eigen::MatrixXd& tangents, Random& random, Ball* ball) const {
  ball->normal.resize(mesh_.d);
  for (int i = 0; i < mesh_.d; ++i) ball->normal[i] = random.NearlyNormal();
  for (int pass = 0; pass < 2; ++pass)
    ball->normal -= tangents * (tangents.transpose() * ball->normal).eval();
  const double length = ball->normal.norm();
  if (!(length > 1e-6) || !(longest_edge_[ball->vertex] > 0)) return false;
  ball->normal /= length;
  return true;
}

// Takes the radius of a ball that touches M `across` from where it began.
void ShrinkingBalls::Touch(Ball* ball, double radius, double across) {
  const double coarseness = longest_edge_[ball->vertex] * std::numbers::inv_sqrt3 / radius;
  coarseness_ = std::max(coarseness_, coarseness);
  coarse_ += !ball->is_coarse && coarseness > kCoarse;
  ball->is_coarse |= coarseness > kCoarse;
  if (radius < reach_) {
    reach_ = radius;
    narrowest_ = ball->vertex;
    distance_ = across;
  }
  ball->radius = kInside * radius;
}

void ShrinkingBalls::ShrinkToVertices(Ball* ball) {
  const double edge = longest_edge_[ball->vertex];
  const double* const p = mesh_.Point(ball->vertex);
  const std::uint64_t step = std::max<std::uint64_t>(1, mesh_.vertices / kVerticesBesideBall);
  double narrowest = ball->radius, across = 0;
  WithDimension(mesh_.d, [&](auto known) {
    const int d = known() > 0 ? known() : mesh_.d;
    for (std::uint64_t v = 0; v < mesh_.vertices; v += step) {
      const double* const q = mesh_.points + v * static_cast<std::uint64_t>(d);
      double along = 0, distance2 = 0;
      for (int i = 0; i < d; ++i) {
        const double away = q[i] - p[i];
        along += ball->normal[i] * away;
        distance2 += away * away;
      }
      if (!(along > 0)) continue;
      const double radius = ReachBound(distance2, along);
      // Vertices are farther apart than the oracle's error.
      if (radius >= narrowest || !IsTelling(std::sqrt(distance2), along, edge, 0)) continue;
      narrowest = radius;
      across = std::sqrt(distance2);
    }
  });
  if (across > 0) Touch(ball, narrowest, across);
}

void ShrinkingBalls::AddLargest(std::uint64_t random_seed, int count) {
  const MeshBox box = BoxOf(mesh_);
  Random random(random_seed, 0x62616c6c73);
  for (int n = 0; n < count; ++n) {
    Ball ball;
    ball.vertex = static_cast<std::uint32_t>(random.Next() % mesh_.vertices);
    ball.radius = (box.upper - box.lower).norm() / 2;
    if (!AimAcross(TangentsOf(ball.vertex), random, &ball)) continue;
    ShrinkToVertices(&ball);
    Add(std::move(ball));
  }
}

void ShrinkingBalls::AddPair(std::uint32_t v, double radius, std::uint64_t random_seed) {
  Ball ball;
  ball.vertex = v;
  ball.radius = radius;
  AddBothSides(std::move(ball), TangentsOf(v), Mix64(random_seed) + v);
}

void ShrinkingBalls::AddPair(const std::uint32_t* simplex, const Eigen::VectorXd& point,
                             const Eigen::MatrixXd& tangents, double radius,
                             std::uint64_t random_key) {
  Ball ball;
  ball.vertex = simplex[0];
  ball.radius = radius;
  ball.point = point;
  ball.tilt = kTilt;
  const std::size_t first = active_.size();
  AddBothSides(std::move(ball), tangents, random_key);
  for (std::size_t b = first; b < active_.size(); ++b)
    for (int i = 0; i <= mesh_.k; ++i)
      active_[b].tilt = std::max(active_[b].tilt, TiltAt(simplex[i], active_[b].normal));
}

double ShrinkingBalls::TiltAt(std::uint32_t v, const Eigen::VectorXd& normal) const {
  return (TangentsOf(v).transpose() * normal).norm();
}

void ShrinkingBalls::AddBothSides(Ball ball, const Eigen::MatrixXd& tangents,
                                  std::uint64_t random_key) {
  Random random(random_key, 0x70616972);
  if (!AimAcross(tangents, random, &ball)) return;
  Add(ball);
  ball.normal = -ball.normal;
  Add(std::move(ball));
}

Eigen::MatrixXd ShrinkingBalls::Centres() const {
  Eigen::MatrixXd centres(mesh_.d, static_cast<Eigen::Index>(active_.size()));
  Eigen::Index next = 0;
  for (const Ball& ball : active_) centres.col(next++) = PointOf(ball) + ball.radius * ball.normal;
  return centres;
}

void ShrinkingBalls::Absorb(const Eigen::MatrixXd& nearest, const std::vector<std::uint8_t>& found,
                            double position_error) {
  std::vector<Ball> still;
  Eigen::Index next = 0;
  for (Ball& ball : active_) {
    const Eigen::Index n = next++;
    if (!found.empty() && !found[static_cast<std::size_t>(n)]) continue;
    const double edge = longest_edge_[ball.vertex];
    const Eigen::VectorXd offset = nearest.col(n) - PointOf(ball);
    const double distance = offset.norm();
    if (distance > kMet * edge)
      met_.insert(met_.end(), nearest.col(n).begin(), nearest.col(n).end());
    const bool exact = ball.point.size() == 0;
    const double along = ball.normal.dot(offset) - ball.tilt * distance;
    const double far = exact ? edge : std::numeric_limits<double>::infinity();
    if (along <= 0 || !IsTelling(distance, along, far, position_error)) continue;
    const double radius = ReachBound(distance * distance, along);
    if (radius >= ball.radius) continue;
    Touch(&ball, radius, distance);
    still.push_back(std::move(ball));
  }
  active_ = std::move(still);
}

}  // namespace stellate::core
