#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "doctor/examination.h"

namespace stellate::doctor {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double Degrees(double radians) { return radians * 180 / std::numbers::pi; }

using Vector = Eigen::VectorXd;

}  // namespace

double Examination::Near() const {
  return options_.epsilon ? std::min(*report_.reach, kNearEpsilons * *options_.epsilon)
                          : *report_.reach;
}

void Examination::AnswersRepeat() {
  const Eigen::MatrixXd& x = probe_.starts;
  const Eigen::MatrixXd first = probe_.Closest(x).points, second = probe_.Closest(x).points;
  // The other way round and in pieces, some of them single.
  Eigen::MatrixXd apart(x.rows(), x.cols());
  for (Eigen::Index at = 0, width = 1; at < x.cols(); at += width) {
    width = at < kSingleQuestions ? 1 : std::min<Eigen::Index>(x.cols() - at, 150);
    const Eigen::MatrixXd part = x.middleCols(at, width).rowwise().reverse();
    apart.middleCols(at, width) = probe_.Closest(part).points.rowwise().reverse();
  }
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    const bool repeats = first.col(j) == second.col(j);
    if (repeats && (first.col(j) - apart.col(j)).norm() <= kBatchSlack * probe_.size) continue;
    const Vector other = (repeats ? apart : second).col(j);
    return Add(repeats ? "BATCH_DEPENDENT" : "NOT_DETERMINISTIC",
               {{"query", Vector(x.col(j))}, {"answer", Vector(first.col(j))}, {"other", other}});
  }
}

void Examination::AnswersStay() {
  const Answered again = probe_.Closest(probe_.points);
  Vector moved = (again.points - probe_.points).colwise().norm();
  for (Eigen::Index j = 0; j < moved.size(); ++j) {
    if (!again.found[j]) moved[j] = kInfinity;
  }
  Eigen::Index worst = 0;
  const double most = moved.maxCoeff(&worst);
  const Vector query = probe_.points.col(worst);
  if (most > Slack()) {
    Add("NOT_IDEMPOTENT",
        {{"query", query}, {"answer", Vector(again.points.col(worst))}, {"moved", most}});
  } else if (most > kNoise * probe_.size) {
    Add("NOISY", {{"query", query}, {"moved", most}});
  }
}

// Far from M a nearer answer is a warning only: solvers find local minima there.
void Examination::AnswersAreClosest() {
  NoneSeenIsNearer(probe_.starts, probe_.points, "NOT_CLOSEST_FAR");
}

void Examination::NoneSeenIsNearer(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y,
                                   const char* code) {
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    const double own = (x.col(j) - y.col(j)).norm();
    Eigen::Index nearest = 0;
    const double seen =
        std::sqrt((probe_.points.colwise() - x.col(j)).colwise().squaredNorm().minCoeff(&nearest));
    if (own <= seen + Slack()) continue;
    return Add(code, {{"query", Vector(x.col(j))},
                      {"answer", Vector(y.col(j))},
                      {"own", own},
                      {"other", Vector(probe_.points.col(nearest))},
                      {"seen", seen}});
  }
}

// Off M along a normal by a part of the reach, and back: closest, and at right angles.
void Examination::NearPointsComeBack() {
  for (const double share : kOffsets) {
    const double away = share * Near();
    const Eigen::MatrixXd all = probe_.some + away * probe_.Normals(probe_.moved_tangents);
    const Answered back = probe_.Closest(all);
    Indices kept;
    for (Eigen::Index j = 0; j < all.cols(); ++j) {
      if (back.found[j] && (all.col(j) - back.points.col(j)).norm() > kLeastOffset * away) {
        kept.push_back(j);
      }
    }
    const Eigen::MatrixXd x = Take(all, kept), y = Take(back.points, kept);
    if (kept.empty()) continue;
    NoneSeenIsNearer(x, y, "NOT_CLOSEST");
    const std::vector<Basis> tangents = probe_.TangentsAt(y);
    for (Eigen::Index j = 0; j < x.cols(); ++j) {
      const Vector v = (x.col(j) - y.col(j)).normalized();
      const double sine = (tangents[static_cast<size_t>(j)].transpose() * v).norm();
      const double degrees = Degrees(std::asin(std::min(1.0, sine)));
      if (degrees <= kToleratedDegrees) continue;
      return Add("NOT_NORMAL",
                 {{"query", Vector(x.col(j))}, {"answer", Vector(y.col(j))}, {"degrees", degrees}});
    }
  }
}

// Samples on an edge are odd ones out, which the smoothness test names better.
void Examination::DimensionIsRight() {
  probe_.FindTangents();
  JudgeRanks(kWrongRanks);
}

void Examination::JudgeRanks(double share) {
  std::vector<size_t> wrong;
  for (size_t j = 0; j < probe_.ranks.size(); ++j) {
    if (probe_.ranks[j] != probe_.k()) wrong.push_back(j);
  }
  if (static_cast<double>(wrong.size()) <= share * static_cast<double>(probe_.ranks.size())) {
    return;
  }
  const Vector query = probe_.some.col(static_cast<Eigen::Index>(wrong[0]));
  Add("WRONG_DIMENSION", {{"query", query}, {"rank", probe_.ranks[wrong[0]]}, {"k", probe_.k()}});
}

void Examination::TangentsAreRight() {
  if (!probe_.gives_tangents()) return Add("NO_TANGENTS", {{"extra", 2 * probe_.k()}});
  const std::vector<Basis> given = probe_.GivenTangents(probe_.some);
  const Basis identity = Basis::Identity(probe_.k(), probe_.k());
  probe_.trusts_given = true;
  for (size_t j = 0; j < given.size(); ++j) {
    const Vector query = probe_.some.col(static_cast<Eigen::Index>(j));
    const double off = (given[j].transpose() * given[j] - identity).cwiseAbs().maxCoeff();
    if (off > kOrthonormalSlack) {
      Add("TANGENT_NOT_ORTHONORMAL", {{"query", query}, {"off", off}});
      probe_.trusts_given = false;
    }
    if (off > kUsableTangents || probe_.ranks[j] != probe_.k() || Has("WRONG_DIMENSION")) continue;
    const double degrees = Degrees(Turn(Orthonormal(given[j]), probe_.moved_tangents[j]));
    if (degrees > kToleratedDegrees) {
      Add("TANGENT_WRONG", {{"query", query}, {"degrees", degrees}});
      probe_.trusts_given = false;
    }
  }
}

void Examination::SizesAreLengths() {
  if (!probe_.gives_sizes()) return;
  const Vector sizes = probe_.GivenSizes(probe_.some);
  for (Eigen::Index j = 0; j < sizes.size(); ++j) {
    if (sizes[j] >= kLeastSize && sizes[j] <= 1 / kLeastSize) continue;
    return Add("SIZE_WRONG", {{"query", Vector(probe_.some.col(j))}, {"size", sizes[j]}});
  }
  for (Eigen::Index j = 0; j < sizes.size(); ++j) {
    const Vector query = probe_.some.col(j);
    const double alone = probe_.GivenSizes(query)[0];
    if (!(std::abs(alone - sizes[j]) <= kSizeSlack * sizes[j])) {
      return Add("SIZE_CHANGES", {{"query", query}, {"size", sizes[j]}, {"other", alone}});
    }
  }
}

void Examination::WallsAreRight() {
  if (probe_.walls() == 0) return;
  walls_.emplace(probe_, [this](Finding finding) { Add(std::move(finding)); });
  walls_->Examine();
}

void Examination::EstimateReach() {
  double reach = kInfinity;
  const double shortest = kShortestWay * probe_.size;
  const std::vector<Basis>& tangents = probe_.moved_tangents;
  for (Eigen::Index j = 0; j < probe_.some.cols(); ++j) {
    for (const auto& q : probe_.points.colwise()) {
      const Vector v = q - probe_.some.col(j);
      reach = std::min(reach, ReachFrom(v, tangents[static_cast<size_t>(j)], shortest));
    }
  }
  const double step = kReachStep * std::min(reach, probe_.size);
  for (int a = 0; a < probe_.k(); ++a) {
    Eigen::MatrixXd x = probe_.some;
    for (Eigen::Index j = 0; j < x.cols(); ++j) {
      x.col(j) += step * tangents[static_cast<size_t>(j)].col(a);
    }
    const Answered q = probe_.Closest(x);
    for (Eigen::Index j = 0; j < x.cols(); ++j) {
      if (!q.found[j]) continue;
      const Vector v = q.points.col(j) - probe_.some.col(j);
      reach = std::min(reach, ReachFrom(v, tangents[static_cast<size_t>(j)], shortest));
    }
  }
  if (walls_) reach = std::min({reach, walls_->Reach(), kFlatReach * probe_.size});
  report_.reach = reach;
  const double advised = kSafeRatio * reach;
  Add("REACH", {{"reach", reach}, {"advised", advised}});
  if (options_.epsilon && *options_.epsilon > advised) {
    Add("COARSE_EPSILON", {{"epsilon", *options_.epsilon},
                           {"ratio", *options_.epsilon / reach},
                           {"reach", reach},
                           {"advised", advised}});
  }
}

// Where tangents turn between two points, halving the way halves the turn: not at corners. Ways
// start at the neighbouring samples that turn most; of two halves the one that turns more is kept.
void Examination::IsSmooth() {
  Eigen::MatrixXd a(probe_.d(), 0), b = a;
  {
    Indices from, to;
    for (const auto& [i, j] : probe_.MostTurnedNeighbours()) {
      from.push_back(i);
      to.push_back(j);
    }
    a = Take(probe_.points, from);
    b = Take(probe_.points, to);
  }
  std::vector<double> turned;
  for (int halving = 0; halving < kHalvings; ++halving) {
    const Answered middle = probe_.Closest((a + b) / 2);
    const std::vector<Basis> ta = probe_.TangentsAt(a), tb = probe_.TangentsAt(b),
                             tm = probe_.TangentsAt(middle.points);
    Indices kept;
    turned.clear();
    for (Eigen::Index j = 0; j < a.cols(); ++j) {
      if (!middle.found[j]) continue;
      const size_t i = static_cast<size_t>(j);
      const double first = Turn(ta[i], tm[i]), second = Turn(tm[i], tb[i]);
      if (first >= second) {
        b.col(j) = middle.points.col(j);
      } else {
        a.col(j) = middle.points.col(j);
      }
      kept.push_back(j);
      turned.push_back(Degrees(std::max(first, second)));
    }
    a = Take(a, kept);
    b = Take(b, kept);
    if (kept.empty()) return;
  }
  for (Eigen::Index j = 0; j < a.cols(); ++j) {
    const double degrees = turned[static_cast<size_t>(j)], length = (a.col(j) - b.col(j)).norm();
    if (degrees <= kCornerDegrees || length >= kCornerLength * probe_.size) continue;
    return Add("ROUGH", {{"query", Vector(a.col(j))}, {"degrees", degrees}, {"length", length}});
  }
}

// Each flat goes through a sample, which it meets M in, and perhaps nearer to its centre.
void Examination::FlatsAreMet() {
  if (!probe_.intersects_flats()) return;
  for (const double tilt : kTilts) {
    std::vector<Basis> bases;
    for (const Basis& tangent : probe_.moved_tangents) {
      const Basis lean = probe_.RandomMatrix(tilt / std::sqrt(static_cast<double>(probe_.d())));
      bases.push_back(Orthonormal(tangent + lean));
    }
    Meet(probe_.some + kFlatOffset * Near() * probe_.Normals(bases), bases);
  }
}

void Examination::Meet(const Eigen::MatrixXd& centers, const std::vector<Basis>& bases) {
  const Vector radii = Vector::Constant(centers.cols(), kFlatRadius * Near());
  const Answered met = probe_.Intersect(centers, bases, radii);
  const Answered again = probe_.Closest(met.points);
  Vector distances(centers.cols());
  for (Eigen::Index j = 0; j < centers.cols(); ++j) {
    const Vector query = centers.col(j), there = probe_.some.col(j), m = met.points.col(j);
    const double seen = (there - query).norm();
    distances[j] = seen;
    if (!met.found[j]) {
      Add("FLAT_MISSED", {{"query", query}, {"answer", there}, {"radius", radii[j]}});
      continue;
    }
    const double own = (m - query).norm();
    const double off = (bases[static_cast<size_t>(j)].transpose() * (m - query)).norm();
    const double moved = again.found[j] ? (again.points.col(j) - m).norm() : kInfinity;
    distances[j] = own;
    if (off > Slack()) Add("FLAT_OFF", {{"query", query}, {"answer", m}, {"off", off}});
    if (moved > Slack()) {
      Add("FLAT_OFF_MANIFOLD", {{"query", query}, {"answer", m}, {"moved", moved}});
    }
    if (own > seen + Slack()) {
      Add("FLAT_NOT_NEAREST",
          {{"query", query}, {"answer", m}, {"other", there}, {"seen", seen}, {"own", own}});
    }
  }
  RadiiAreKept(centers, bases, distances);
}

void Examination::RadiiAreKept(const Eigen::MatrixXd& centers, const std::vector<Basis>& bases,
                               const Eigen::VectorXd& distances) {
  const Vector radii = kShortRadius * distances;
  const Answered met = probe_.Intersect(centers, bases, radii);
  for (Eigen::Index j = 0; j < centers.cols(); ++j) {
    const double own = (met.points.col(j) - centers.col(j)).norm();
    if (!met.found[j] || own <= radii[j] + Slack()) continue;
    return Add("FLAT_OUTSIDE_RADIUS", {{"query", Vector(centers.col(j))},
                                       {"answer", Vector(met.points.col(j))},
                                       {"own", own},
                                       {"radius", radii[j]}});
  }
}

}  // namespace stellate::doctor
