#include "core/run/crease_probe.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <cmath>
#include <utility>

#include "core/base/basis_layout.h"

namespace stellate::core {
namespace {

// Sine of ten degrees: what turns by less on a short way is no crease that a mesh could not follow.
constexpr double kLeastSine = 0.17364817766693033;
// A walk's end: a manifold that is smooth, and turns by as much on so short a way, bends
// 20,000 times as sharply as the mesh is fine.
constexpr double kShare = 1.0 / 4096;
constexpr int kMostLegs = 24;
// A leg is no longer than this share of that before; nor so short that rounding has its ends.
constexpr double kLongestLeg = 0.75;
constexpr double kShortestLeg = 1e-3;
constexpr double kKeptSine = 0.5;  // of the sine, by each leg
// On either side of a crease tangent spaces agree, by this share of what they differ by across it,
// and so many times as far from it as the way is long: noise has no sides, and what bends with some
// radius turns on beyond a way of that length.
constexpr double kAgree = 1.0 / 3, kNearSide = 4, kFarSide = 64;
constexpr double kAround = 1.0 / 16;       // of a way: so far about its corner is looked
constexpr double kDifference = 1.0 / 128;  // of it: for tangents by differences
constexpr double kBeyond = 8;              // times it: whether M goes on there
constexpr double kStays = 0.3;             // of how far off M a step beyond a crease would be
constexpr double kParallel = 0.05;         // of directions that meet nowhere
constexpr double kFarthestCorner = 2;      // of a way's length, from its middle

constexpr Eigen::Index kAsked = 8, kSteps = 4;

// Of the space that `of` spans the unit direction that is farthest off `off`, and its sine.
std::pair<Eigen::VectorXd, double> FarthestOff(const Eigen::MatrixXd& of,
                                               const Eigen::MatrixXd& off) {
  const Eigen::MatrixXd beside = of - off * (off.transpose() * of);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(beside.transpose() * beside);
  const Eigen::Index last = of.cols() - 1;
  return {of * solver.eigenvectors().col(last),
          std::sqrt(std::max(solver.eigenvalues()[last], 0.0))};
}

// Where the tangent spaces at both ends come nearest to each other, nearest to the middle: on a
// crease between flat sides. The middle, where that is far away.
Eigen::VectorXd CornerOf(const Way& way) {
  const Eigen::Index d = way.a.size(), k = way.at_a.cols();
  const Eigen::VectorXd middle = (way.a + way.b) / 2;
  Eigen::MatrixXd span(d, 2 * k + 1);
  span << way.at_a, way.at_b, (way.b - way.a).normalized();
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(span);
  const Eigen::MatrixXd basis =
      qr.householderQ() * Eigen::MatrixXd::Identity(d, std::min(d, span.cols()));
  Eigen::MatrixXd off(2 * d, basis.cols());
  off << basis - way.at_a * (way.at_a.transpose() * basis),
      basis - way.at_b * (way.at_b.transpose() * basis);
  Eigen::VectorXd to(2 * d);
  const Eigen::VectorXd from_a = way.a - middle, from_b = way.b - middle;
  to << from_a - way.at_a * (way.at_a.transpose() * from_a),
      from_b - way.at_b * (way.at_b.transpose() * from_b);
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver;
  solver.setThreshold(kParallel);
  solver.compute(off);
  const Eigen::VectorXd step = basis * solver.solve(to);
  return step.norm() <= kFarthestCorner * way.length() ? (middle + step).eval() : middle;
}

}  // namespace

double SineBetween(const Eigen::MatrixXd& one, const Eigen::MatrixXd& other) {
  return FarthestOff(one, other).second;
}

CreaseProbe::CreaseProbe(int k, int d, bool gives_tangents, bool has_walls, std::uint64_t seed)
    : k_(k),
      d_(d),
      gives_tangents_(gives_tangents),
      has_walls_(has_walls),
      finder_(k, d, 1, seed) {}

void CreaseProbe::Start(std::vector<Way> ways) {
  stage_ = Stage::kPoints;
  walks_.clear();
  crease_.reset();
  for (Way& way : ways) {
    Walk walk;
    walk.first_length = way.length();
    walk.sine = SineBetween(way.at_a, way.at_b);
    walk.way = std::move(way);
    if (walk.first_length > 0 && walk.sine >= kLeastSine) walks_.push_back(std::move(walk));
  }
}

// Along the way, and about its corner, to both sides along either tangent space.
Eigen::MatrixXd CreaseProbe::PointsAbout(const Way& way) const {
  const Eigen::VectorXd step = (way.b - way.a) / 4, corner = CornerOf(way);
  const Eigen::VectorXd along_a = kAround * way.length() * FarthestOff(way.at_a, way.at_b).first;
  const Eigen::VectorXd along_b = kAround * way.length() * FarthestOff(way.at_b, way.at_a).first;
  Eigen::MatrixXd points(d_, kAsked);
  points << way.a + step, way.a + 2 * step, way.a + 3 * step, corner, corner + along_a,
      corner - along_a, corner + along_b, corner - along_b;
  return points;
}

Eigen::MatrixXd CreaseProbe::StepsFrom(const Way& way) const {
  const Eigen::VectorXd corner = CornerOf(way);
  const Eigen::VectorXd along_a = kBeyond * way.length() * FarthestOff(way.at_a, way.at_b).first;
  const Eigen::VectorXd along_b = kBeyond * way.length() * FarthestOff(way.at_b, way.at_a).first;
  Eigen::MatrixXd points(d_, kSteps);
  points << corner + along_a, corner - along_a, corner + along_b, corner - along_b;
  return points;
}

std::vector<QueryBlock> CreaseProbe::Questions() {
  if (!is_asking()) return {};
  QueryBlock block;
  block.kind = QueryKind::kClosestPoint;
  if (stage_ == Stage::kTangents) {
    block = *finder_.Next();
  } else if (stage_ == Stage::kSteps) {
    block.points = StepsFrom(walks_.front().way);
  } else {
    block.want_tangents = gives_tangents_;
    block.points.resize(d_, kAsked * static_cast<Eigen::Index>(walks_.size()));
    for (std::size_t w = 0; w < walks_.size(); ++w)
      block.points.middleCols(kAsked * static_cast<Eigen::Index>(w), kAsked) =
          PointsAbout(walks_[w].way);
  }
  block.want_clearances = has_walls_;
  return {std::move(block)};
}

void CreaseProbe::Absorb(const std::vector<AnswerBlock>& answers) {
  switch (stage_) {
    case Stage::kPoints:
      return TakePoints(answers.front());
    case Stage::kTangents:
      finder_.Absorb(answers.front());
      if (finder_.Next() == nullptr) TakeTangents();
      return;
    case Stage::kSteps:
      return TakeSteps(answers.front());
  }
}

void CreaseProbe::TakePoints(const AnswerBlock& answer) {
  std::vector<Eigen::Index> found;
  walk_of_.clear();
  for (Eigen::Index c = 0; c < answer.points.cols(); ++c) {
    if (!answer.found.empty() && !answer.found[static_cast<std::size_t>(c)]) continue;
    found.push_back(c);
    walk_of_.push_back(static_cast<std::size_t>(c / kAsked));
  }
  for (Walk& walk : walks_) {
    walk.nodes = {{walk.way.a, walk.way.at_a}, {walk.way.b, walk.way.at_b}};
  }
  found_ = answer.points(Eigen::all, found);
  if (found.empty()) return GoOn();
  if (gives_tangents_) {
    for (std::size_t i = 0; i < found.size(); ++i) {
      Walk& walk = walks_[walk_of_[i]];
      walk.nodes.push_back({answer.points.col(found[i]), Eigen::MatrixXd(d_, k_)});
      ToByVector(answer.tangents.col(found[i]).data(), d_, k_, walk.nodes.back().basis.data());
    }
    return GoOn();
  }
  std::vector<double> steps;
  for (const std::size_t w : walk_of_) steps.push_back(kDifference * walks_[w].way.length());
  finder_.Start(found_, std::vector<const double*>(found.size(), nullptr), std::move(steps));
  stage_ = Stage::kTangents;
}

void CreaseProbe::TakeTangents() {
  for (std::size_t i = 0; i < walk_of_.size(); ++i) {
    if (!finder_.ok()[i]) continue;
    const auto c = static_cast<Eigen::Index>(i);
    Walk& walk = walks_[walk_of_[i]];
    walk.nodes.push_back({found_.col(c), Eigen::Map<const Eigen::MatrixXd>(
                                             finder_.tangents().col(c).data(), d_, k_)});
  }
  GoOn();
}

// Each walk goes a leg on, as far as it leads anywhere; the first that is at its end is looked at
// alone.
void CreaseProbe::GoOn() {
  stage_ = Stage::kPoints;
  std::vector<Walk> left;
  for (Walk& walk : walks_) {
    if (!TakeLeg(&walk)) continue;
    if (IsSettled(walk)) {
      stage_ = Stage::kSteps;
      left.clear();
      left.push_back(std::move(walk));
      break;
    }
    if (walk.legs < kMostLegs) left.push_back(std::move(walk));
  }
  walks_ = std::move(left);
}

// The shortest way between two points that were found, of those on which the tangent spaces still
// turn.
bool CreaseProbe::TakeLeg(Walk* walk) const {
  const double length = walk->way.length();
  double shortest = kLongestLeg * length;
  std::optional<Way> next;
  double sine = 0;
  const std::vector<Node>& nodes = walk->nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const double apart = (nodes[i].point - nodes[j].point).norm();
      if (apart >= shortest || apart < kShortestLeg * length) continue;
      const double turn = SineBetween(nodes[j].basis, nodes[i].basis);
      if (turn < std::max(kLeastSine, kKeptSine * walk->sine)) continue;
      next = Way{nodes[j].point, nodes[i].point, nodes[j].basis, nodes[i].basis};
      shortest = apart;
      sine = turn;
    }
  if (!next) return false;
  walk->before.insert(walk->before.end(), nodes.begin(), nodes.end());
  walk->way = std::move(*next);
  walk->sine = sine;
  ++walk->legs;
  return true;
}

bool CreaseProbe::IsSettled(const Walk& walk) const {
  if (walk.way.length() > kShare * walk.first_length) return false;
  bool with_a = false, with_b = false;
  for (const Node& node : walk.before) {
    const double away = (node.point - walk.way.a).norm() / walk.way.length();
    if (away < kNearSide || away > kFarSide) continue;
    with_a = with_a || SineBetween(node.basis, walk.way.at_a) <= kAgree * walk.sine;
    with_b = with_b || SineBetween(node.basis, walk.way.at_b) <= kAgree * walk.sine;
  }
  return with_a && with_b;
}

// Of a step along a side beyond a crease no point of M is near; beyond a crossing there is one.
void CreaseProbe::TakeSteps(const AnswerBlock& answer) {
  const Walk& walk = walks_.front();
  const Eigen::MatrixXd steps = StepsFrom(walk.way);
  Crease crease;
  crease.point = CornerOf(walk.way);
  crease.sine = walk.sine;
  crease.length = walk.way.length();
  crease.crosses = true;
  for (Eigen::Index c = 0; c < kSteps; ++c) {
    if (!answer.found.empty() && !answer.found[static_cast<std::size_t>(c)]) continue;
    const double off = (answer.points.col(c) - steps.col(c)).norm();
    if (off > kStays * walk.sine * kBeyond * crease.length) crease.crosses = false;
  }
  crease_ = std::move(crease);
}

}  // namespace stellate::core
