#include "core/examination/wall_laws.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/base/dense.h"
#include "core/base/infinity.h"
#include "core/examination/constants.h"

namespace stellate::core::examination {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

MatrixXd Kept(const Answered& answered) {
  Indices kept;
  for (Index j = 0; j < answered.points.cols(); ++j)
    if (answered.found[j]) kept.push_back(j);
  return Take(answered.points, kept);
}

}  // namespace

WallLaws::WallLaws(Probe& probe, std::function<void(Finding)> add)
    : probe_(probe), add_(std::move(add)), slack_(kClearanceSlack * probe.size) {}

Task<> WallLaws::Obey() {
  const Index most = std::max(kSome, kStarts / probe_.walls());
  const MatrixXd queries = Take(probe_.points, Spread(probe_.points.cols(), most));
  bool any = false;
  std::set<int> unseen;
  for (int wall = 0; wall < probe_.walls(); ++wall) {
    const Answered answered = co_await probe_.FacePoints(queries, SetOfWall(wall));
    MatrixXd found = Kept(answered);
    const bool was_found = found.cols() > 0;
    if (was_found) found = co_await One(wall, std::move(found));
    points_.push_back(std::move(found));
    any = any || points_.back().cols() > 0;
    if (was_found) continue;
    const bool crosses = co_await Crosses(wall);
    if (crosses) unseen.insert(wall);
  }
  if (!any && unseen.empty()) co_await AnythingLeft();
  int pairs = any && probe_.k() > 1 ? kFacePairs : 0;
  for (int wall = 0; wall < probe_.walls(); ++wall) {
    for (int other = wall + 1; other < probe_.walls() && pairs > 0; ++other, --pairs) {
      const WallSet both = SetOfWall(wall) | SetOfWall(other);
      const Answered answered = co_await probe_.FacePoints(probe_.some, both);
      co_await Two(wall, other, Kept(answered));
    }
  }
  for (int wall = 0; wall < probe_.walls(); ++wall) {
    if (points_[static_cast<std::size_t>(wall)].cols() == 0 && !unseen.contains(wall))
      Add("WALL_CUTS_NOTHING", {{"wall", wall}});
  }
}

Task<double> WallLaws::Reach() {
  double reach = kInfinity;
  for (int wall = 0; wall < probe_.walls(); ++wall) {
    const MatrixXd points = points_[static_cast<std::size_t>(wall)];
    if (points.cols() == 0) continue;
    const FaceAnswers at = co_await probe_.OnFace(points, SetOfWall(wall));
    const std::vector<Basis> bases = co_await probe_.GivenTangents(points);
    for (Index j = 0; j < points.cols(); ++j) {
      const Basis& basis = bases[static_cast<std::size_t>(j)];
      const MatrixXd along = basis.transpose() * at.conormals.col(j);
      const MatrixXd turned = OrthonormalBasis(along, basis.cols());
      const Basis edge = basis * turned.rightCols(basis.cols() - 1);
      for (const auto& q : points.colwise())
        reach = std::min(reach, ReachFrom(q - points.col(j), edge, kShortestWay * probe_.size));
    }
  }
  co_return reach;
}

Task<MatrixXd> WallLaws::OnManifold(int wall, MatrixXd found) {
  const Answered again = co_await probe_.Closest(found);
  Indices on;
  for (Index j = 0; j < found.cols(); ++j) {
    const double moved = again.found[j] ? (again.points.col(j) - found.col(j)).norm() : kInfinity;
    if (moved > slack_) {
      Add("FACE_OFF_MANIFOLD", {{"wall", wall}, {"query", Vector(found.col(j))}, {"moved", moved}});
    } else {
      on.push_back(j);
    }
  }
  co_return Take(found, on);
}

Task<MatrixXd> WallLaws::One(int wall, MatrixXd found) {
  Face face;
  face.wall = wall;
  face.points = co_await OnManifold(wall, std::move(found));
  if (face.points.cols() == 0) co_return face.points;
  face.bases = co_await probe_.GivenTangents(face.points);
  face.at = co_await probe_.OnFace(face.points, SetOfWall(wall));
  face.at.clearances = co_await probe_.Clearances(face.points);
  face.slopes = co_await Slopes(wall, face.points, face.bases);
  MatrixXd inside = Judge(face);
  co_await Closest(wall, std::move(face.points));
  co_return inside;
}

MatrixXd WallLaws::Judge(const Face& face) {
  const int wall = face.wall;
  const Vector steep = face.slopes.colwise().norm();
  const double least = kLeastSteepness * Median(steep);
  Indices inside;
  for (Index j = 0; j < face.points.cols(); ++j) {
    const Vector query = face.points.col(j);
    Vector others = face.at.clearances.col(j);
    others[wall] = 0;
    if (others.minCoeff() >= -slack_) inside.push_back(j);
    const bool touches = steep[j] <= least;
    if (touches) Add("WALL_TOUCHES", {{"wall", wall}, {"query", query}});
    const double value = face.at.clearances(wall, j);
    const double off = std::abs(value) / std::max(steep[j], 1e-300);
    if (!touches && off > slack_) {
      Add("FACE_CLEARANCE", {{"wall", wall}, {"query", query}, {"clearance", value}, {"off", off}});
    }
    const Vector slope = touches ? Vector::Zero(probe_.k()) : Vector(face.slopes.col(j));
    JudgeConormal(wall, query, face.bases[static_cast<std::size_t>(j)], face.at.conormals.col(j),
                  slope);
  }
  return Take(face.points, inside);
}

void WallLaws::JudgeConormal(int wall, const Vector& y, const Basis& basis, const Vector& n,
                             const Vector& slope) {
  const double length = n.norm();
  const Vector unit = n / std::max(length, 1e-300), along = basis.transpose() * unit;
  if (std::abs(length - 1) > kConormalSlack) {
    Add("CONORMAL_NOT_UNIT", {{"wall", wall}, {"query", y}, {"length", length}});
  }
  const double out = (unit - basis * along).norm();
  if (out > kConormalSlack) {
    Add("CONORMAL_NOT_TANGENT", {{"wall", wall}, {"query", y}, {"degrees", DegreesOfSine(out)}});
  }
  const double steep = slope.norm();
  if (!(steep > 0)) return;
  const double turned =
      DegreesOfCosine(-along.dot(slope) / (std::max(along.norm(), 1e-300) * steep));
  if (turned > 90) {
    Add("CONORMAL_INWARD", {{"wall", wall}, {"query", y}});
  } else if (turned > kToleratedDegrees) {
    Add("CONORMAL_WRONG", {{"wall", wall}, {"query", y}, {"degrees", turned}});
  }
}

MatrixXd WallLaws::Astride(const Vector& value) const {
  MatrixXd ends(probe_.d(), 0);  // inside, outside
  double way = kInfinity;
  for (Index i = 0; i < value.size(); ++i) {
    for (Index j = 0; j < value.size(); ++j) {
      if (!(value[i] > 0 && value[j] < 0)) continue;
      const double length = (probe_.points.col(i) - probe_.points.col(j)).norm();
      if (length >= way) continue;
      way = length;
      ends = Take(probe_.points, {i, j});
    }
  }
  return ends;
}

Task<bool> WallLaws::Crosses(int wall) {
  const MatrixXd clearances = co_await probe_.Clearances(probe_.points);
  MatrixXd ends = Astride(clearances.row(wall).transpose());
  if (ends.cols() == 0) co_return false;
  for (double way = kInfinity; way > slack_;) {
    way = (ends.col(0) - ends.col(1)).norm();
    const Answered middle = co_await probe_.Closest((ends.col(0) + ends.col(1)) / 2);
    if (!middle.found[0]) co_return false;
    const Vector at = middle.points.col(0);
    const double farthest = std::max((at - ends.col(0)).norm(), (at - ends.col(1)).norm());
    if (farthest > kFarthestMiddle * way) co_return false;  // they are on two components
    const MatrixXd there = co_await probe_.Clearances(at);
    ends.col(there(wall, 0) > 0 ? 0 : 1) = at;
  }
  Add("FACE_NOT_FOUND", {{"wall", wall}, {"query", Vector(ends.col(0))}});
  co_return true;
}

Task<MatrixXd> WallLaws::Slopes(int wall, MatrixXd y, std::vector<Basis> bases) {
  const double h = kDifferentialStep * probe_.size;
  MatrixXd slopes(probe_.k(), y.cols());
  for (int a = 0; a < probe_.k(); ++a) {
    MatrixXd step(y.rows(), y.cols());
    for (Index j = 0; j < y.cols(); ++j)
      step.col(j) = h * bases[static_cast<std::size_t>(j)].col(a);
    const Answered ahead = co_await probe_.Closest(y + step);
    const Answered behind = co_await probe_.Closest(y - step);
    const MatrixXd value_ahead = co_await probe_.Clearances(ahead.points);
    const MatrixXd value_behind = co_await probe_.Clearances(behind.points);
    slopes.row(a) = (value_ahead.row(wall) - value_behind.row(wall)) / (2 * h);
  }
  co_return slopes;
}

Task<> WallLaws::Closest(int wall, MatrixXd y) {
  const double away = kFaceOffset * probe_.size;
  const MatrixXd x = y + away * probe_.RandomUnits(y.cols());
  const Answered answered = co_await probe_.FacePoints(x, SetOfWall(wall));
  for (Index j = 0; j < x.cols(); ++j) {
    if (!answered.found[j]) {
      Add("FACE_MISSED", {{"wall", wall},
                          {"query", Vector(x.col(j))},
                          {"other", Vector(y.col(j))},
                          {"seen", away}});
      co_return;
    }
    const double own = (answered.points.col(j) - x.col(j)).norm();
    if (own <= away + slack_) continue;
    Add("FACE_NOT_CLOSEST", {{"wall", wall},
                             {"query", Vector(x.col(j))},
                             {"answer", Vector(answered.points.col(j))},
                             {"own", own},
                             {"other", Vector(y.col(j))},
                             {"seen", away}});
    co_return;
  }
}

Task<> WallLaws::Two(int wall, int other, MatrixXd found) {
  const MatrixXd clearances = co_await probe_.Clearances(found);
  Indices inside;
  for (Index j = 0; j < found.cols(); ++j)
    if (clearances.col(j).minCoeff() >= -slack_) inside.push_back(j);
  const MatrixXd y = Take(found, inside);
  const FaceAnswers at = co_await probe_.OnFace(y, SetOfWall(wall) | SetOfWall(other));
  JudgeAngles(wall, other, y, at);
}

void WallLaws::JudgeAngles(int wall, int other, const MatrixXd& y, const FaceAnswers& at) {
  for (Index j = 0; j < y.cols(); ++j) {
    const double cosine = -at.conormals.col(j).dot(at.others.col(j));
    const double degrees = DegreesOfCosine(cosine);
    const Vector query = y.col(j);
    if (1 - std::abs(cosine) < (cosine > 0 ? kLeastTransversality : kLeastBlunt)) {
      Add("WALLS_TANGENTIAL",
          {{"wall", wall}, {"other", other}, {"query", query}, {"degrees", degrees}});
    } else if (degrees < kAcuteDegrees && probe_.k() > 2) {
      Add("ACUTE_EDGE", {{"wall", wall},
                         {"other", other},
                         {"query", query},
                         {"degrees", degrees},
                         {"least", kAcuteDegrees}});
    }
  }
}

Task<> WallLaws::AnythingLeft() {
  const MatrixXd clearances = co_await probe_.Clearances(probe_.points);
  if ((clearances.colwise().minCoeff().array() >= 0).any()) co_return;
  Index wall = 0;
  clearances.col(0).minCoeff(&wall);
  Add("NOTHING_LEFT",
      {{"n", probe_.points.cols()}, {"query", Vector(probe_.points.col(0))}, {"wall", wall}});
}

}  // namespace stellate::core::examination
