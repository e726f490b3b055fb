#include "core/run/crease_probe.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/basis_layout.h"
#include "core/base/dense.h"

namespace stellate::core {
namespace {

// Sine of ten degrees: a mesh can follow a crease with a smaller angle.
constexpr double kLeastSine = 0.17364817766693033;
// In mesh sizes: a walk ends at a way so short. A smooth manifold that turns as much along so short
// a way has a curvature thousands of times that of the mesh size.
constexpr double kShare = 1.0 / 2048;
// A way up to so long, also in mesh sizes, whose turn is lost in each shorter way, is examined
// before the walk goes on: an oracle that takes gradients by differences rounds every crease in its
// tangents, though not in its points, over the length of a difference.
constexpr double kLongestEnd = 1.0 / 16;
constexpr int kMostLegs = 48;
// A leg is no longer than this share of the one before; and no shorter than this one, lest it be
// below the oracle's own differences, or rounding.
constexpr double kLongestLeg = 0.75;
constexpr double kShortestLeg = 0.2;
constexpr double kKeptSine = 0.5;          // of the sine, by each leg
constexpr double kSteepSine = 0.8;         // ... by a leg that is preferred to others
constexpr double kAround = 3.0 / 16;       // of a way's length: queries around its corner
constexpr double kDifference = 1.0 / 128;  // ... tangents by differences
// At the end of a walk, points are queried at these multiples of the way's length from its corner,
// along either tangent space. On the sides of a crease M is straight between them, up to this share
// of its turn. Noise has no sides, and a curved manifold turns further there.
constexpr double kBeyond = 8, kFarBeyond = 32, kNearest = 4;
constexpr double kAgree = 1.0 / 3;
constexpr double kOnTheWay = 0.35;  // the way's share of the turn between the sides
constexpr double kStays = 0.3;      // of the distance from M of a step beyond a crease
constexpr double kSharp = 0.1;      // of the way times its turn: M is so near where its sides meet
// ... for a longer way. A round edge turns in more than a quarter of a way that has no shorter one
// as steep, and passes where its sides meet at more than this.
constexpr double kVerySharp = 0.03;
constexpr double kOpposite = -0.95;    // cosine: a side continues in the opposite direction
constexpr double kParallel = 0.05;     // singular values: directions do not meet
constexpr double kFarthestCorner = 2;  // of a way's length, from its middle
constexpr double kFarthestTip = 6;     // ... that of a cone whose sides are 10 degrees off its axis

constexpr Eigen::Index kAsked = 12, kSteps = 4;  // steps, as far each of both

// Returns the unit direction in the span of `of` with the largest angle to the span of `off`, and
// the sine of that angle.
std::pair<Eigen::VectorXd, double> FarthestOff(const Eigen::MatrixXd& of,
                                               const Eigen::MatrixXd& off) {
  const Eigen::MatrixXd beside = of - off * (off.transpose() * of);
  const SymmetricEigen eigen = EigenOfSymmetric(beside.transpose() * beside);
  const Eigen::Index last = of.cols() - 1;
  return {of * eigen.vectors.col(last), std::sqrt(std::max(eigen.values[last], 0.0))};
}

using TangentSpace = std::pair<Eigen::VectorXd, Eigen::MatrixXd>;  // at a point, its basis

// Returns the point where tangent spaces, at points of M, are nearest to each other, the one that
// is nearest to `middle`: between flat sides it is on the crease, and it is the tip of a cone, of
// which there are three or more. Returns `middle` if that point is farther from it than `farthest`.
Eigen::VectorXd MeetingOf(const std::vector<TangentSpace>& spaces, const Eigen::VectorXd& middle,
                          double farthest) {
  const Eigen::Index d = middle.size(), k = spaces.front().second.cols();
  const auto count = static_cast<Eigen::Index>(spaces.size());
  Eigen::MatrixXd span(d, count * (k + 1) - 1);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto& [point, basis] = spaces[static_cast<std::size_t>(i)];
    span.middleCols(i * k, k) = basis;
    if (i > 0) span.col(count * k + i - 1) = (point - spaces.front().first).normalized();
  }
  const Eigen::MatrixXd basis = PivotedBasis(span, std::min(d, span.cols()));
  Eigen::MatrixXd off(count * d, basis.cols());
  Eigen::VectorXd to(count * d);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto& [point, tangent] = spaces[static_cast<std::size_t>(i)];
    const Eigen::VectorXd from = point - middle;
    off.middleRows(i * d, d) = basis - tangent * (tangent.transpose() * basis);
    to.segment(i * d, d) = from - tangent * (tangent.transpose() * from);
  }
  const Eigen::VectorXd step = basis * ShortestLeastSquares(off, to, kParallel);
  return step.norm() <= farthest ? (middle + step).eval() : middle;
}

Eigen::VectorXd CornerOf(const Way& way) {
  return MeetingOf({{way.a, way.at_a}, {way.b, way.at_b}}, (way.a + way.b) / 2,
                   kFarthestCorner * way.length());
}

}  // namespace

double SineBetween(const Eigen::MatrixXd& one, const Eigen::MatrixXd& other) {
  return FarthestOff(one, other).second;
}

CreaseProbe::CreaseProbe(const Specification& spec)
    : k_(spec.dimension),
      d_(spec.ambient_dimension),
      size_(spec.epsilon),
      gives_tangents_(spec.oracle.tangent_basis),
      policy_(spec),
      finder_(k_, d_, 1, spec.random_seed) {}

void CreaseProbe::Start(std::vector<Way> ways) {
  is_difference_ = looks_beyond_ = false;
  walks_.clear();
  crease_.reset();
  unconfirmed_.reset();
  tip_.reset();
  for (Way& way : ways) {
    Walk walk;
    walk.sine = SineBetween(way.at_a, way.at_b);
    walk.way = std::move(way);
    if (walk.way.length() > 0 && walk.sine >= kLeastSine) walks_.push_back(std::move(walk));
  }
}

// Returns points along the way, around its corner, and around where all the tangent spaces that
// were found last meet, to both sides along either tangent space.
Eigen::MatrixXd CreaseProbe::PointsAbout(const Walk& walk) const {
  const Way& way = walk.way;
  const Eigen::VectorXd step = (way.b - way.a) / 4, corner = CornerOf(way);
  std::vector<TangentSpace> spaces{{way.a, way.at_a}, {way.b, way.at_b}};
  for (const Node& node : walk.nodes) spaces.emplace_back(node.point, node.basis);
  const Eigen::VectorXd tip = MeetingOf(spaces, (way.a + way.b) / 2, kFarthestTip * way.length());
  const Eigen::VectorXd along_a = kAround * way.length() * FarthestOff(way.at_a, way.at_b).first;
  const Eigen::VectorXd along_b = kAround * way.length() * FarthestOff(way.at_b, way.at_a).first;
  Eigen::MatrixXd points(d_, kAsked);
  points << way.a + step, way.a + 2 * step, way.a + 3 * step, corner, corner + along_a,
      corner - along_a, corner + along_b, corner - along_b, tip + along_a, tip - along_a,
      tip + along_b, tip - along_b;
  return points;
}

// Returns points far beyond the way's corner, to both sides along either tangent space, at two
// distances.
Eigen::MatrixXd CreaseProbe::StepsFrom(const Way& way) const {
  const Eigen::VectorXd corner = CornerOf(way);
  const Eigen::VectorXd along_a = way.length() * FarthestOff(way.at_a, way.at_b).first;
  const Eigen::VectorXd along_b = way.length() * FarthestOff(way.at_b, way.at_a).first;
  Eigen::MatrixXd points(d_, 2 * kSteps);
  points << corner + kBeyond * along_a, corner - kBeyond * along_a, corner + kBeyond * along_b,
      corner - kBeyond * along_b, corner + kFarBeyond * along_a, corner - kFarBeyond * along_a,
      corner + kFarBeyond * along_b, corner - kFarBeyond * along_b;
  return points;
}

std::vector<QueryBlock> CreaseProbe::Questions() {
  if (!is_asking()) return {};
  QueryBlock block;
  block.kind = QueryKind::kClosestPoint;
  if (unconfirmed_) {
    block.points = unconfirmed_->point;
  } else if (is_difference_) {
    block = std::move(finder_.Questions().front());
  } else if (looks_beyond_) {
    block.want.tangents = gives_tangents_;
    block.points = StepsFrom(walks_.front().way);
  } else {
    block.want.tangents = gives_tangents_;
    block.points.resize(d_, kAsked * static_cast<Eigen::Index>(walks_.size()));
    for (std::size_t w = 0; w < walks_.size(); ++w)
      block.points.middleCols(kAsked * static_cast<Eigen::Index>(w), kAsked) =
          PointsAbout(walks_[w]);
  }
  policy_.AddWishes(&block);
  return {std::move(block)};
}

void CreaseProbe::Absorb(const std::vector<AnswerBlock>& answers) {
  if (unconfirmed_) return TakeCorner(answers.front());
  if (!is_difference_) return TakePoints(answers.front());
  finder_.Absorb(answers);
  if (finder_.is_done()) TakeTangents();
}

void CreaseProbe::TakePoints(const AnswerBlock& answer) {
  std::vector<Eigen::Index> found;
  for (Eigen::Index c = 0; c < answer.points.cols(); ++c)
    if (answer.found.empty() || answer.found[static_cast<std::size_t>(c)]) found.push_back(c);
  for (Walk& walk : walks_) {
    walk.nodes.clear();
    if (!looks_beyond_)
      walk.nodes = {{-1, walk.way.a, walk.way.at_a}, {-1, walk.way.b, walk.way.at_b}};
  }
  found_ = answer.points(Eigen::all, found);
  asked_ = found;
  if (found.empty()) return GoOn();
  if (gives_tangents_) {
    for (const Eigen::Index c : found) {
      Node node{c, answer.points.col(c), Eigen::MatrixXd(d_, k_)};
      ToByVector(answer.tangents.col(c).data(), d_, k_, node.basis.data());
      WalkOf(c).nodes.push_back(std::move(node));
    }
    return GoOn();
  }
  std::vector<double> steps;
  steps.reserve(found.size());
  for (const Eigen::Index c : found) steps.push_back(kDifference * WalkOf(c).way.length());
  finder_.Start({found_, std::vector<const double*>(found.size(), nullptr), std::move(steps)});
  is_difference_ = true;
}

// Returns the walk that sent a query.
CreaseProbe::Walk& CreaseProbe::WalkOf(Eigen::Index asked) {
  return looks_beyond_ ? walks_.front() : walks_[static_cast<std::size_t>(asked / kAsked)];
}

void CreaseProbe::TakeTangents() {
  is_difference_ = false;
  for (std::size_t i = 0; i < asked_.size(); ++i) {
    if (!finder_.ok()[i]) continue;
    const auto c = static_cast<Eigen::Index>(i);
    WalkOf(asked_[i]).nodes.push_back(
        {asked_[i], found_.col(c),
         Eigen::Map<const Eigen::MatrixXd>(finder_.tangents().col(c).data(), d_, k_)});
  }
  GoOn();
}

// Continues each walk by a leg, or drops it if there is none. A walk that has become short enough
// is examined alone, and dropped if there is no crease.
void CreaseProbe::GoOn() {
  if (looks_beyond_) {
    looks_beyond_ = false;
    unconfirmed_ = WhatIsAt(walks_.front());
    if (unconfirmed_) return;
    LeaveEnd();
  } else {
    std::erase_if(walks_, [&](Walk& walk) { return !GoesOn(&walk); });
  }
  ChooseEnd();
}

// Continues the walk, or lets it end early. Returns false if it can do neither.
bool CreaseProbe::GoesOn(Walk* walk) const {
  walk->next = NextLeg(*walk);
  const bool is_lost = !walk->next || !walk->next->is_steep;
  walk->ends_early = is_lost && !walk->has_ended_early && walk->way.length() <= kLongestEnd * size_;
  return walk->ends_early || TakeLeg(walk);
}

// Continues the first walk, which has ended early at no crease. Drops it if it has ended.
void CreaseProbe::LeaveEnd() {
  Walk& walk = walks_.front();
  const bool was_early = std::exchange(walk.ends_early, false);
  walk.has_ended_early = true;
  if (!was_early || !TakeLeg(&walk)) walks_.erase(walks_.begin());
}

// M reaches the point where its sides meet if that is a crease; a rounded or passing manifold stays
// away. If the oracle finds nothing there, M has no tangent space there.
void CreaseProbe::TakeCorner(const AnswerBlock& answer) {
  const bool found = answer.found.empty() || answer.found.front() != 0;
  const double off = (answer.points.col(0) - unconfirmed_->point).norm();
  const double sharp = walks_.front().ends_early ? kVerySharp : kSharp;
  if (!found || off <= sharp * turn_ * unconfirmed_->length) {
    crease_ = std::move(unconfirmed_);
    unconfirmed_.reset();
    return;
  }
  if (tip_) {
    unconfirmed_->point = *std::exchange(tip_, std::nullopt);
    return;
  }
  unconfirmed_.reset();
  LeaveEnd();
  ChooseEnd();
}

void CreaseProbe::ChooseEnd() {
  const auto ends = std::find_if(walks_.begin(), walks_.end(), [&](const Walk& walk) {
    return walk.ends_early || walk.way.length() <= kShare * size_;
  });
  if (ends == walks_.end()) return;
  std::swap(*ends, walks_.front());
  looks_beyond_ = true;
}

// Returns the shortest way between two points found on which the tangent spaces still turn as much;
// if there is none, on which they turn half as much.
std::optional<CreaseProbe::Leg> CreaseProbe::NextLeg(const Walk& walk) const {
  const double length = walk.way.length();
  std::optional<Leg> next;
  double shortest = 0;
  const std::vector<Node>& nodes = walk.nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const double apart = (nodes[i].point - nodes[j].point).norm();
      if (apart > kLongestLeg * length || apart < kShortestLeg * length) continue;
      const double turn = SineBetween(nodes[j].basis, nodes[i].basis);
      if (turn < std::max(kLeastSine, kKeptSine * walk.sine)) continue;
      const bool steep = turn >= kSteepSine * walk.sine;
      if (next && (next->is_steep == steep ? apart >= shortest : next->is_steep)) continue;
      next = Leg{{nodes[j].point, nodes[i].point, nodes[j].basis, nodes[i].basis}, turn, steep};
      shortest = apart;
    }
  return next;
}

// Returns false if there is no next leg, or the walk has had too many.
bool CreaseProbe::TakeLeg(Walk* walk) {
  if (!walk->next || ++walk->legs >= kMostLegs) return false;
  walk->way = std::move(walk->next->way);
  walk->sine = walk->next->sine;
  walk->next.reset();
  return true;
}

// Decides what is at the end of a walk. A crease has at least two straight sides, and the way
// itself turns by most of the angle between them. No point of M is near a step along a side beyond
// a crease, and an oracle that projects by gradients may find none at all; there is one beyond a
// crossing, and through the tip of a cone a side continues straight.
std::optional<Crease> CreaseProbe::WhatIsAt(const Walk& walk) {
  const double length = walk.way.length();
  const Eigen::MatrixXd steps = StepsFrom(walk.way);
  Crease crease;
  crease.point = CornerOf(walk.way);
  crease.sine = walk.sine;
  crease.length = length;
  std::vector<const Node*> at(2 * kSteps, nullptr);
  for (const Node& node : walk.nodes) at[static_cast<std::size_t>(node.asked)] = &node;
  std::vector<const Node*> sides;
  std::size_t stay = 0;
  for (std::size_t s = 0; s < kSteps; ++s) {
    const Node *near = at[s], *far = at[s + kSteps];
    if (near == nullptr) continue;
    const double off = (near->point - steps.col(static_cast<Eigen::Index>(s))).norm();
    if (off <= kStays * walk.sine * kBeyond * length) ++stay;
    if (far == nullptr || (near->point - crease.point).norm() < kNearest * length) continue;
    const Eigen::VectorXd along = (far->point - near->point).normalized();
    const double bends = (along - near->basis * (near->basis.transpose() * along)).norm();
    if (std::max(bends, SineBetween(near->basis, far->basis)) <= kAgree * walk.sine)
      sides.push_back(near);
  }
  double turn = 0;
  Eigen::VectorXd meet, middle;
  bool goes_through = false;
  for (const Node* one : sides)
    for (const Node* other : sides) {
      const double between = SineBetween(one->basis, other->basis);
      if (between > turn) {
        turn = between;
        meet = CornerOf({one->point, other->point, one->basis, other->basis});
      }
      const double cosine =
          (one->point - crease.point).normalized().dot((other->point - crease.point).normalized());
      if (goes_through || cosine > kOpposite || between > kAgree * walk.sine) continue;
      goes_through = true;
      middle = (one->point + other->point) / 2;
    }
  if (turn < kLeastSine || walk.sine < kOnTheWay * turn) return std::nullopt;
  crease.crosses = goes_through || stay >= kSteps - 1;
  crease.point = goes_through ? middle : meet;
  turn_ = turn;
  std::vector<TangentSpace> spaces{{walk.way.a, walk.way.at_a}, {walk.way.b, walk.way.at_b}};
  for (const Node* side : sides) spaces.emplace_back(side->point, side->basis);
  tip_ = MeetingOf(spaces, (walk.way.a + walk.way.b) / 2, kFarthestCorner * length);
  return crease;
}

}  // namespace stellate::core
