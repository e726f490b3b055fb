#include "server/oracles/wall_signs.h"

#include <algorithm>
#include <cmath>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Brief;
using core::Message;
using Eigen::Index;

// Points that show how a wall's values change over M. Seeds may all lie on the wall.
constexpr Index kEnoughPoints = 64;

}  // namespace

WallSigns::WallSigns(const core::Specification& spec)
    : spec_(spec), walls_(static_cast<std::size_t>(spec.walls)) {}

void WallSigns::Learn(const core::AnswerBlock& answer) {
  if (answer.clearances.cols() != answer.size()) return;
  for (Index j = 0; j < answer.size(); ++j) {
    if (!answer.found.empty() && answer.found[static_cast<std::size_t>(j)] == 0) continue;
    const auto point = answer.points.col(j);
    low_ = seen_ == 0 ? Eigen::VectorXd(point) : Eigen::VectorXd(low_.cwiseMin(point));
    high_ = seen_ == 0 ? Eigen::VectorXd(point) : Eigen::VectorXd(high_.cwiseMax(point));
    for (std::size_t w = 0; w < walls_.size(); ++w) {
      const double value = answer.clearances(static_cast<Index>(w), j);
      walls_[w].lowest = seen_ == 0 ? value : std::min(walls_[w].lowest, value);
      walls_[w].highest = seen_ == 0 ? value : std::max(walls_[w].highest, value);
    }
    ++seen_;
  }
}

void WallSigns::Compare(const core::QueryBlock& block, Index query, const AnswerRef& a,
                        const AnswerRef& b) {
  const bool have_both = a.answers->clearances.size() > 0 && b.answers->clearances.size() > 0;
  if (!have_both || !a.found() || !b.found()) return;
  const double between = (a.answers->points.col(a.at) - b.answers->points.col(b.at)).norm();
  if (between > AllowedApart(spec_, block, query, a, b)) return;
  for (std::size_t w = 0; w < walls_.size(); ++w) {
    const auto wall = static_cast<int>(w);
    if ((block.face & core::SetOfWall(wall)) != 0) continue;  // it is zero there
    const double mine = a.answers->clearances(wall, a.at);
    const double theirs = b.answers->clearances(wall, b.at);
    const double apart = std::abs(mine - theirs);
    if ((mine < 0) == (theirs < 0) || apart <= walls_[w].apart) continue;
    walls_[w].apart = apart;
    walls_[w].words = DescribeDisagreement(
        block, query, a, b,
        Message("the clearances of wall ", wall, " there are ", Brief(mine), " and ", Brief(theirs),
                ": what is inside for the one is outside for the other"));
  }
}

std::string WallSigns::Verdict() const {
  if (seen_ < kEnoughPoints) return "";
  const double across = (high_ - low_).norm();
  for (const Wall& wall : walls_) {
    if (wall.words.empty() || !(across > 0)) continue;
    const double slope = (wall.highest - wall.lowest) / across;
    if (wall.apart > slope * kDisagreementTolerance * spec_.epsilon) return wall.words;
  }
  return "";
}

}  // namespace stellate::server
