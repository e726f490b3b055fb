#include "doctor/walls.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include "shared/doctor.h"

namespace stellate::doctor {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr double kNowhere = std::numeric_limits<double>::infinity();

double DegreesOf(double cosine) {
  return std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
}

// The columns that were found.
MatrixXd Kept(const Answered& answered) {
  Indices kept;
  for (Index j = 0; j < answered.points.cols(); ++j) {
    if (answered.found[j]) kept.push_back(j);
  }
  return Take(answered.points, kept);
}

double Median(const VectorXd& values) {
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  const size_t half = sorted.size() / 2;
  return sorted.size() % 2 == 1 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

}  // namespace

WallProbe::WallProbe(Probe& probe, std::function<void(Finding)> add)
    : probe_(probe), add_(std::move(add)), slack_(kClearanceSlack * probe.size) {}

void WallProbe::Examine() {
  const Index most = std::max(kSome, kStarts / probe_.walls());
  const Index stride = std::max<Index>(1, probe_.points.cols() / most);
  Indices chosen;
  for (Index j = 0; j < probe_.points.cols(); j += stride) chosen.push_back(j);
  const MatrixXd questions = Take(probe_.points, chosen);
  bool any = false;
  std::set<int> unseen;
  for (int wall = 0; wall < probe_.walls(); ++wall) {
    const MatrixXd found = Kept(probe_.FacePoints(questions, {wall}));
    points_.push_back(found.cols() > 0 ? One(wall, found) : found);
    any = any || points_.back().cols() > 0;
    if (found.cols() == 0 && Crosses(wall)) unseen.insert(wall);
  }
  if (!any && unseen.empty()) AnythingLeft();
  int pairs = any && probe_.k() > 1 ? kFacePairs : 0;
  for (int wall = 0; wall < probe_.walls(); ++wall) {
    for (int other = wall + 1; other < probe_.walls() && pairs > 0; ++other, --pairs) {
      Two(wall, other, Kept(probe_.FacePoints(probe_.some, {wall, other})));
    }
  }
  for (int wall = 0; wall < probe_.walls(); ++wall) {
    if (points_[static_cast<size_t>(wall)].cols() == 0 && !unseen.contains(wall)) {
      Add("WALL_CUTS_NOTHING", {{"wall", wall}});
    }
  }
}

double WallProbe::Reach() {
  double reach = kNowhere;
  for (int wall = 0; wall < probe_.walls(); ++wall) {
    const MatrixXd& points = points_[static_cast<size_t>(wall)];
    if (points.cols() == 0) continue;
    const MatrixXd normals = probe_.Conormals(points, {wall});
    const std::vector<Basis> bases = probe_.GivenTangents(points);
    for (Index j = 0; j < points.cols(); ++j) {
      const Basis& basis = bases[static_cast<size_t>(j)];
      const VectorXd along = basis.transpose() * normals.col(j);
      const MatrixXd turned = Eigen::HouseholderQR<MatrixXd>(along).householderQ();
      const Basis rim = basis * turned.rightCols(basis.cols() - 1);
      for (const auto& q : points.colwise()) {
        reach = std::min(reach, ReachFrom(q - points.col(j), rim, kShortestWay * probe_.size));
      }
    }
  }
  return reach;
}

MatrixXd WallProbe::OnManifold(int wall, const MatrixXd& found) {
  const Answered again = probe_.Closest(found);
  Indices on;
  for (Index j = 0; j < found.cols(); ++j) {
    const double moved = again.found[j] ? (again.points.col(j) - found.col(j)).norm() : kNowhere;
    if (moved > slack_) {
      Add("FACE_OFF_MANIFOLD", {{"wall", wall}, {"query", Vector(found.col(j))}, {"moved", moved}});
    } else {
      on.push_back(j);
    }
  }
  return Take(found, on);
}

MatrixXd WallProbe::One(int wall, const MatrixXd& found) {
  MatrixXd y = OnManifold(wall, found);
  if (y.cols() == 0) return y;
  const std::vector<Basis> bases = probe_.GivenTangents(y);
  const MatrixXd normals = probe_.Conormals(y, {wall}), slopes = Slopes(wall, y, bases),
                 clearances = probe_.Clearances(y);
  const VectorXd steep = slopes.colwise().norm();
  const double least = kLeastSteepness * Median(steep);
  Indices inside;
  for (Index j = 0; j < y.cols(); ++j) {
    const Vector query = y.col(j);
    VectorXd others = clearances.col(j);
    others[wall] = 0;
    if (others.minCoeff() >= -slack_) inside.push_back(j);
    const bool touches = steep[j] <= least;
    if (touches) Add("WALL_TOUCHES", {{"wall", wall}, {"query", query}});
    const double value = clearances(wall, j), off = std::abs(value) / std::max(steep[j], 1e-300);
    if (!touches && off > slack_) {
      Add("FACE_CLEARANCE", {{"wall", wall}, {"query", query}, {"clearance", value}, {"off", off}});
    }
    const VectorXd slope = touches ? VectorXd::Zero(probe_.k()) : VectorXd(slopes.col(j));
    Conormal(wall, query, bases[static_cast<size_t>(j)], normals.col(j), slope);
  }
  Closest(wall, y);
  return Take(y, inside);
}

bool WallProbe::Crosses(int wall) {
  const VectorXd value = probe_.Clearances(probe_.points).row(wall);
  std::pair<VectorXd, VectorXd> ends;  // inside, outside
  double way = kNowhere;
  for (Index i = 0; i < value.size(); ++i) {
    for (Index j = 0; j < value.size(); ++j) {
      if (!(value[i] > 0 && value[j] < 0)) continue;
      const double length = (probe_.points.col(i) - probe_.points.col(j)).norm();
      if (length >= way) continue;
      way = length;
      ends = {probe_.points.col(i), probe_.points.col(j)};
    }
  }
  if (way == kNowhere) return false;
  for (; way > slack_; way = (ends.first - ends.second).norm()) {
    const Answered middle = probe_.Closest((ends.first + ends.second) / 2);
    if (!middle.found[0]) return false;
    const VectorXd at = middle.points.col(0);
    const double farthest = std::max((at - ends.first).norm(), (at - ends.second).norm());
    if (farthest > kFarthestMiddle * way) return false;  // they are on two components
    (probe_.Clearances(at)(wall, 0) > 0 ? ends.first : ends.second) = at;
  }
  Add("FACE_NOT_FOUND", {{"wall", wall}, {"query", Vector(ends.first)}});
  return true;
}

void WallProbe::Conormal(int wall, const Vector& y, const Basis& basis, const Vector& n,
                         const Vector& slope) {
  const double length = n.norm();
  const VectorXd unit = n / std::max(length, 1e-300), along = basis.transpose() * unit;
  if (std::abs(length - 1) > kConormalSlack) {
    Add("CONORMAL_NOT_UNIT", {{"wall", wall}, {"query", y}, {"length", length}});
  }
  const double out = std::min(1.0, (unit - basis * along).norm());
  if (out > kConormalSlack) {
    const double degrees = std::asin(out) * 180 / std::numbers::pi;
    Add("CONORMAL_NOT_TANGENT", {{"wall", wall}, {"query", y}, {"degrees", degrees}});
  }
  const double steep = slope.norm();
  if (!(steep > 0)) return;
  const double turned = DegreesOf(-along.dot(slope) / (std::max(along.norm(), 1e-300) * steep));
  if (turned > 90) {
    Add("CONORMAL_INWARD", {{"wall", wall}, {"query", y}});
  } else if (turned > kToleratedDegrees) {
    Add("CONORMAL_WRONG", {{"wall", wall}, {"query", y}, {"degrees", turned}});
  }
}

MatrixXd WallProbe::Slopes(int wall, const MatrixXd& y, const std::vector<Basis>& bases) {
  const double h = kDifferentialStep * probe_.size;
  MatrixXd slopes(probe_.k(), y.cols());
  for (int a = 0; a < probe_.k(); ++a) {
    MatrixXd step(y.rows(), y.cols());
    for (Index j = 0; j < y.cols(); ++j) {
      step.col(j) = h * bases[static_cast<size_t>(j)].col(a);
    }
    const VectorXd ahead = probe_.Clearances(probe_.Closest(y + step).points).row(wall).transpose();
    const VectorXd behind =
        probe_.Clearances(probe_.Closest(y - step).points).row(wall).transpose();
    slopes.row(a) = (ahead - behind).transpose() / (2 * h);
  }
  return slopes;
}

void WallProbe::Closest(int wall, const MatrixXd& y) {
  const double away = kFaceOffset * probe_.size;
  const MatrixXd x = y + away * probe_.RandomUnits(y.cols());
  const Answered answered = probe_.FacePoints(x, {wall});
  for (Index j = 0; j < x.cols(); ++j) {
    const double own = answered.found[j] ? (answered.points.col(j) - x.col(j)).norm() : kNowhere;
    if (own <= away + slack_) continue;
    return Add("FACE_NOT_CLOSEST", {{"wall", wall},
                                    {"query", Vector(x.col(j))},
                                    {"answer", Vector(answered.points.col(j))},
                                    {"own", own},
                                    {"other", Vector(y.col(j))},
                                    {"seen", away}});
  }
}

void WallProbe::Two(int wall, int other, const MatrixXd& found) {
  if (found.cols() == 0) return;
  const VectorXd least = probe_.Clearances(found).colwise().minCoeff();
  Indices inside;
  for (Index j = 0; j < found.cols(); ++j) {
    if (least[j] >= -slack_) inside.push_back(j);
  }
  if (inside.empty()) return;
  const MatrixXd y = Take(found, inside), n = probe_.Conormals(y, {wall, other});
  for (Index j = 0; j < y.cols(); ++j) {
    const double cosine = -n.col(j).head(y.rows()).dot(n.col(j).tail(y.rows()));
    const double degrees = DegreesOf(cosine);
    const Vector query = y.col(j);
    if (1 - std::abs(cosine) < kLeastTransversality) {
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

void WallProbe::AnythingLeft() {
  const MatrixXd clearances = probe_.Clearances(probe_.points);
  if ((clearances.colwise().minCoeff().array() >= 0).any()) return;
  Index wall = 0;
  clearances.col(0).minCoeff(&wall);
  Add("NOTHING_LEFT", {{"n", static_cast<std::int64_t>(probe_.points.cols())},
                       {"query", Vector(probe_.points.col(0))},
                       {"wall", static_cast<int>(wall)}});
}

}  // namespace stellate::doctor
