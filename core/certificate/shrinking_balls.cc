#include "core/certificate/shrinking_balls.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/certificate/probes.h"
#include "core/sample/random.h"

namespace stellate::core {
namespace {

constexpr double kTellingDistance = 0.5;  // of the longest edge at the vertex
// A ball is asked about at slightly less than the radius found: the centre of the very ball that
// touches M twice is on the medial axis, where oracles divide by zero.
constexpr double kInside = 0.98;
constexpr int kLadder = 6;

using ConstPoint = Eigen::Map<const Eigen::VectorXd>;

ConstPoint PointOf(const MeshView& mesh, std::uint32_t v) {
  return ConstPoint(mesh.points + std::size_t{v} * mesh.d, mesh.d);
}

}  // namespace

ShrinkingBalls::ShrinkingBalls(const MeshView& mesh, const std::vector<double>& longest_edge,
                               std::uint64_t random_seed, int count)
    : mesh_(mesh), reach_(std::numeric_limits<double>::infinity()) {
  const int d = mesh.d;
  const int k = mesh.k;
  const MeshBox box = BoxOf(mesh);
  const double start = (box.upper - box.lower).norm() / 2;

  Random random(random_seed, 0x62616c6c73);
  for (int n = 0; n < count; ++n) {
    Ball ball;
    ball.vertex = static_cast<std::uint32_t>(random.Next() % mesh.vertices);
    for (int rung = 0; rung < kLadder; ++rung) ball.radii.push_back(std::ldexp(start, -rung));
    ball.scale = kTellingDistance * longest_edge[ball.vertex];
    ball.normal.resize(d);
    for (int i = 0; i < d; ++i) ball.normal[i] = random.Normal();
    const Eigen::Map<const Eigen::MatrixXd> tangent(mesh.Tangent(ball.vertex), d, k);
    for (int pass = 0; pass < 2; ++pass) {
      ball.normal -= tangent * (tangent.transpose() * ball.normal).eval();
    }
    const double length = ball.normal.norm();
    if (!(length > 1e-6) || !(ball.scale > 0)) continue;
    ball.normal /= length;
    active_.push_back(std::move(ball));
  }
}

Eigen::MatrixXd ShrinkingBalls::Centres() const {
  Eigen::Index count = 0;
  for (const Ball& ball : active_) count += static_cast<Eigen::Index>(ball.radii.size());
  Eigen::MatrixXd centres(mesh_.d, count);
  Eigen::Index next = 0;
  for (const Ball& ball : active_)
    for (const double radius : ball.radii)
      centres.col(next++) = PointOf(mesh_, ball.vertex) + radius * ball.normal;
  return centres;
}

void ShrinkingBalls::Absorb(const Eigen::MatrixXd& nearest,
                            const std::vector<std::uint8_t>& found) {
  std::vector<Ball> still;
  Eigen::Index next = 0;
  for (Ball& ball : active_) {
    double narrowest = std::numeric_limits<double>::infinity();
    for (const double asked : ball.radii) {
      const Eigen::Index n = next++;
      if (!found.empty() && !found[static_cast<std::size_t>(n)]) continue;
      const Eigen::VectorXd offset = nearest.col(n) - PointOf(mesh_, ball.vertex);
      const double distance = offset.norm();
      const double along = ball.normal.dot(offset);
      if (distance < ball.scale || along <= 0) continue;
      const double radius = distance * distance / (2 * along);
      if (radius < asked) narrowest = std::min(narrowest, radius);
    }
    if (std::isinf(narrowest)) continue;
    const double circumradius = ball.scale / kTellingDistance * std::numbers::inv_sqrt3;
    coarseness_ = std::max(coarseness_, circumradius / narrowest);
    if (narrowest < reach_) {
      reach_ = narrowest;
      narrowest_ = ball.vertex;
    }
    ball.radii.assign(1, kInside * narrowest);
    still.push_back(std::move(ball));
  }
  active_ = std::move(still);
}

}  // namespace stellate::core
