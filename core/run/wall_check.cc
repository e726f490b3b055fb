#include "core/run/wall_check.h"

#include <Eigen/Core>
#include <bit>
#include <map>
#include <string>

#include "core/base/dense.h"
#include "core/base/message.h"
#include "core/certificate/findings.h"

namespace stellate::core {
namespace {

constexpr const char* kOrTooSmall =
    ". Or the wall bends within that step, about a void or a piece far smaller than epsilon: leave "
    "it out of the wall, or take epsilon smaller than it";

constexpr int kPointsOfWall = 4;
// Conormals turned by 0.2 radians did no harm in trials; turned by 0.3 they did.
constexpr double kTangentOfMostTurned = 0.2027100355086725;
// As a share of a step: a point farther off is another point.
constexpr double kOff = 0.5;

}  // namespace

Eigen::MatrixXd WallCheck::Questions(const AnsweredPoints& answers) {
  std::map<WallSet, int> taken;
  std::vector<Eigen::VectorXd> asked;
  for (Eigen::Index c = 0; c < answers.points.cols(); ++c) {
    const auto i = static_cast<std::size_t>(c);
    const WallSet walls = answers.walls[i];
    if (!answers.found[i] || CountWalls(walls) != 1 || answers.Beyond(c)) continue;
    if (taken[walls]++ >= kPointsOfWall) continue;
    const Eigen::VectorXd p = answers.points.col(c);
    const Eigen::Map<const Eigen::MatrixXd> tangents(answers.tangents.col(c).data(), d_, k_);
    const Eigen::VectorXd within = answers.conormals.col(c).head(k_);
    const Eigen::VectorXd conormal = tangents * within;
    sampled_.push_back({std::countr_zero(walls), p, conormal});
    asked.push_back(p);
    asked.push_back(p + step_ * conormal);
    if (k_ == 1) asked.push_back(p - step_ * conormal);
    // The other columns of an orthogonal matrix that has the conormal as its first, up to sign.
    const Eigen::MatrixXd q = OrthonormalBasis(within, k_);
    for (int a = 1; a < k_; ++a)
      for (const double sign : {1.0, -1.0})
        asked.push_back(p +
                        step_ * (sign * (tangents * q.col(a)) - kTangentOfMostTurned * conormal));
  }
  Eigen::MatrixXd points(d_, static_cast<Eigen::Index>(asked.size()));
  for (std::size_t n = 0; n < asked.size(); ++n)
    points.col(static_cast<Eigen::Index>(n)) = asked[n];
  return points;
}

Status WallCheck::Judge(const AnsweredPoints& answers) const {
  Eigen::Index c = 0;
  for (const Sampled& at : sampled_) {
    const Eigen::Index itself = c, out = c + 1, along = c + 2;
    c += steps();
    const auto found = [&](Eigen::Index j) { return answers.found[static_cast<std::size_t>(j)]; };
    const auto clearance = [&](Eigen::Index j) { return answers.clearances(at.wall, j); };
    const std::string where = Message("wall ", at.wall, " at its point ", NamePoint(at.point));
    const double off = found(itself) ? (answers.points.col(itself) - at.point).norm() : 0;
    if (off > kOff * step_)
      return {StatusCode::kOracleNotIdempotent,
              Message(where, " is not on the manifold: that is ", Brief(off),
                      " away; points of a face are on the manifold and on the face's walls")};
    const bool went =
        found(out) && (answers.points.col(out) - at.point).dot(at.conormal) > kOff * step_;
    const bool inward = went && clearance(out) > 0;
    bool turned = false;
    for (Eigen::Index j = along; j < c; ++j) turned = turned || (found(j) && clearance(j) < 0);
    if (inward && !turned)
      return {StatusCode::kOracleNotIdempotent,
              Message(where, " does not end the manifold: a step of ", Brief(step_),
                      " out of it, along its conormal, has a clearance of ", Brief(clearance(out)),
                      ", which is inside; points of a face are where its walls are 0, and the "
                      "clearances are negative beyond",
                      kOrTooSmall)};
    if (turned)
      return {StatusCode::kOracleBadConormal,
              Message("the conormal of ", where,
                      inward ? " points inward: " : " is turned by more than 0.2 radians: ",
                      "beside it, a step of ", Brief(step_),
                      " along the wall and a fifth of that inward, is beyond the wall. It must be "
                      "the outward unit normal of the wall within the tangent space: the direction "
                      "in which the wall's value falls",
                      kOrTooSmall)};
  }
  return Status::Ok();
}

}  // namespace stellate::core
