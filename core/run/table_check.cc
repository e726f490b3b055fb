#include "core/run/table_check.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/base/interruption.h"
#include "core/base/message.h"
#include "core/base/name_point.h"
#include "core/list_walls.h"

namespace stellate::core {
namespace {

// As shares of a wall's largest clearance: below the first its sign is left to rounding; up to the
// second it may be zero, for a careful solver.
constexpr double kNoSign = 1e-9;
constexpr double kZero = 1e-6;

// One point of a face may happen to be on another wall, too.
constexpr int kPointsThatTell = 3;

std::string NameSigns(WallSet signs, int walls) {
  std::string name;
  for (int wall = 0; wall < walls; ++wall) name += IsSubset(SetOfWall(wall), signs) ? '+' : '-';
  return name;
}

}  // namespace

Status TableCheck::Judge(const AnsweredPoints& answers, int k) {
  const LabelTable& labels = answers.labels;
  if (labels.empty()) return Status::Ok();
  const auto walls = static_cast<int>(answers.clearances.rows());
  if (largest_.size() == 0) largest_.setZero(walls);
  const auto is_known = [&](Eigen::Index c) {  // INFINITY stands for what was not asked
    return answers.found[static_cast<std::size_t>(c)] && std::isfinite(answers.clearances(0, c));
  };
  for (Eigen::Index c = 0; c < answers.clearances.cols(); ++c)
    if (is_known(c)) largest_ = largest_.cwiseMax(answers.clearances.col(c).cwiseAbs());
  for (Eigen::Index c = 0; c < answers.clearances.cols(); ++c) {
    CheckInterruption(static_cast<std::size_t>(c));
    if (!is_known(c)) continue;
    const WallSet face = answers.walls[static_cast<std::size_t>(c)];
    const auto clearances = answers.clearances.col(c);
    const auto away = [&](int wall) { return std::abs(clearances[wall]) / largest_[wall]; };
    WallSet unknown = face;
    for (int wall = 0; wall < walls; ++wall)
      if (!(away(wall) > kNoSign)) unknown |= SetOfWall(wall);
    const std::string at = NamePoint(answers.points.col(c));
    if (!labels.IsPossible(answers.SignsOf(c), unknown))
      return {StatusCode::kInvalidArgument,
              Message("labels say that no point has the signs ",
                      NameSigns(answers.SignsOf(c), walls), " of the walls, by number, but ", at,
                      " has them: give that sign vector its label, or correct the walls"),
              "labels"};
    const int codimension = labels.Codimension(face);
    if (const WallSet others = unknown & ~face;
        others != 0 && codimension >= 2 && codimension < k &&
        labels.Active(face | others, answers.SignsOf(c)) != face &&
        labels.Piece(face, answers.SignsOf(c)) != 0 &&
        ++coincidences_[{face, others}] >= kPointsThatTell)
      return {StatusCode::kInvalidArgument,
              Message("walls ", ListWalls(face), " and ", ListWalls(others),
                      " are all zero along one face, at ", at,
                      " among others, and labels differ across all of them: move one of them a "
                      "little, so that they meet in fewer points"),
              "labels"};
    if (codimension == CountWalls(face)) continue;
    int worst = kNoWall;
    ForEachWall(face, [&](int wall) {
      if (away(wall) > kZero && (worst == kNoWall || away(wall) > away(worst))) worst = wall;
    });
    if (worst != kNoWall)
      return {StatusCode::kInvalidArgument,
              Message("closures say that walls ", ListWalls(face), " vanish together, but at ", at,
                      ", where most of them do, wall ", worst, " has the clearance ",
                      Brief(clearances[worst]),
                      ": each wall of a closure is zero wherever all others of it are; "
                      "queries of a face are for points where all its walls are zero"),
              "closures"};
  }
  return Status::Ok();
}

}  // namespace stellate::core
