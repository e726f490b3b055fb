#include "core/run/repeat_check.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "core/base/message.h"

namespace stellate::core {
namespace {

// Answers that are queried once more.
constexpr Eigen::Index kSample = 64;
// Closest points of answered points may move by this share of epsilon: positions wrong by 0.01
// epsilon are still meshed well.
constexpr double kIdempotenceTolerance = 1e-3;
// A point moved by no more of the distances between numbers there was moved by rounding.
constexpr double kRoundings = 64;

}  // namespace

void RepeatCheck::Sample(const AnsweredPoints& answers) {
  std::vector<Eigen::Index> chosen;
  for (Eigen::Index c = 0; c < answers.points.cols(); ++c)
    if (answers.found[static_cast<std::size_t>(c)] && std::ssize(chosen) < kSample)
      chosen.push_back(c);
  points_ = answers.points(Eigen::all, chosen);
  sizes_.resize(0);
  if (answers.sizes.size() > 0) sizes_ = answers.sizes(chosen);
}

QueryBlock RepeatCheck::Questions() const {
  QueryBlock block;
  block.points = points_;
  block.want.sizes = sizes_.size() > 0;
  return block;
}

Status RepeatCheck::Judge(const Answers& answers) const {
  if (!has_questions()) return Status::Ok();
  const AnswerBlock& again = answers.blocks.back();
  for (Eigen::Index i = 0; i < points_.cols(); ++i) {
    if (!again.found.empty() && !again.found[static_cast<std::size_t>(i)]) continue;
    const double moved = (again.points.col(i) - points_.col(i)).norm();
    if (moved <= kIdempotenceTolerance * epsilon_) {
      const bool told = sizes_.size() > 0 && again.sizes.size() > 0;
      if (!told || AreOneSize(again.sizes[i], sizes_[i])) continue;
      return {StatusCode::kOracleBadSize,
              Message("query ", i, " of block ", answers.blocks.size() - 1,
                      " was a point that closest_point itself had returned: its size was ",
                      sizes_[i], " then and is ", again.sizes[i],
                      " now; the size must depend on the point alone")};
    }
    std::string message = Message(
        "closest_point is not idempotent: query ", i, " of block ", answers.blocks.size() - 1,
        " was a point that closest_point itself had returned, and it was moved by ", moved,
        ", more than ", kIdempotenceTolerance,
        " epsilon; closest_point must leave points of the manifold where they are");
    const double apart =
        std::numeric_limits<double>::epsilon() * points_.col(i).lpNorm<Eigen::Infinity>();
    if (moved <= kRoundings * apart)
      message += Message("; there, so far from the origin for this epsilon, numbers are ",
                         Brief(apart), " apart: move the manifold nearer");
    return {StatusCode::kOracleNotIdempotent, std::move(message)};
  }
  return Status::Ok();
}

}  // namespace stellate::core
