#include "server/oracles/cross_check.h"

#include <algorithm>
#include <cmath>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Brief;
using core::Message;
using Eigen::Index;

constexpr Index kMostCoordinates = 12;  // of a point, in a message

std::string PointText(const Eigen::VectorXd& point) {
  std::string text = "(";
  for (Index i = 0; i < std::min(point.size(), kMostCoordinates); ++i) {
    text += (i > 0 ? ", " : "") + Message(point[i]);
  }
  if (point.size() > kMostCoordinates) text += ", ...";
  return text + ")";
}

// "wall 3", "walls 0 and 2".
std::string WallsText(core::WallSet walls) {
  std::string text;
  int left = core::CountWalls(walls);
  core::ForEachWall(walls, [&](int wall) {
    text += Message(wall);
    if (--left > 0) text += left > 1 ? ", " : " and ";
  });
  return (core::CountWalls(walls) > 1 ? "walls " : "wall ") + text;
}

// Sine of the angle at which the worst vector of basis `b` leaves the span of basis `a`; both d x k
// in C order, orthonormal.
double LargestSine(const double* a, const double* b, Index d, Index k) {
  double worst = 0;
  for (Index v = 0; v < k; ++v) {
    Eigen::VectorXd rest(d);
    for (Index i = 0; i < d; ++i) rest[i] = b[i * k + v];
    for (Index u = 0; u < k; ++u) {
      double dot = 0;
      for (Index i = 0; i < d; ++i) dot += a[i * k + u] * b[i * k + v];
      for (Index i = 0; i < d; ++i) rest[i] -= dot * a[i * k + u];
    }
    worst = std::max(worst, rest.norm());
  }
  return worst;
}

// Returns how the conormals of the walls of `face`, d rows each, disagree, or "".
std::string CompareConormals(core::WallSet face, Index d, const AnswerRef& a, const AnswerRef& b) {
  if (a.answers->conormals.size() == 0 || b.answers->conormals.size() == 0) return "";
  std::string rule;
  Index row = 0;
  core::ForEachWall(face, [&](int wall) {
    const Eigen::VectorXd mine = a.answers->conormals.col(a.at).segment(row, d).normalized();
    const Eigen::VectorXd theirs = b.answers->conormals.col(b.at).segment(row, d).normalized();
    row += d;
    const double cosine = mine.dot(theirs), sine = (theirs - cosine * mine).norm();
    if (!rule.empty() || (cosine > 0 && sine <= kConormalDisagreement)) return;
    rule = cosine <= -std::sqrt(1 - kConormalDisagreement * kConormalDisagreement)
               ? Message("the conormals of wall ", wall,
                         " there are opposite: what is inside for "
                         "the one is outside for the other")
               : Message("the conormals of wall ", wall, " there have an angle of cosine ",
                         Brief(cosine), " and sine ", Brief(sine), ", more than the ",
                         kConormalDisagreement, " allowed");
  });
  return rule;
}

}  // namespace

bool AnswerRef::found() const {
  return answers->found.empty() || answers->found[static_cast<std::size_t>(at)] != 0;
}

std::string DescribeDisagreement(const core::QueryBlock& block, Index query, const AnswerRef& a,
                                 const AnswerRef& b, const std::string& rule) {
  const Eigen::VectorXd x = block.points.col(query);
  const auto says = [&](const AnswerRef& t) {
    const Eigen::VectorXd point = t.answers->points.col(t.at);
    return Message(t.worker, " answered ",
                   t.found() ? PointText(point) + ", " + Brief((point - x).norm()) + " away"
                             : "\"not found\"");
  };
  const bool flat = block.kind == core::QueryKind::kIntersectFlat;
  return Message(flat ? "intersect_flat query " : "closest_point query ", query,
                 block.face != 0 ? " on " + WallsText(block.face) : "", " at ", PointText(x), ": ",
                 says(a), ", and ", says(b), "; ", rule, ": serve one manifold by all workers");
}

double AllowedApart(const core::Specification& spec, const core::QueryBlock& block, Index query,
                    const AnswerRef& a, const AnswerRef& b) {
  const double largest = std::max({block.points.col(query).lpNorm<Eigen::Infinity>(),
                                   a.answers->points.col(a.at).lpNorm<Eigen::Infinity>(),
                                   b.answers->points.col(b.at).lpNorm<Eigen::Infinity>()});
  return kDisagreementTolerance * spec.epsilon + core::kRoundingTolerance * largest;
}

std::string FindDisagreement(const core::Specification& spec, const core::QueryBlock& block,
                             Index query, const AnswerRef& a, const AnswerRef& b) {
  const bool flat = block.kind == core::QueryKind::kIntersectFlat;
  const Eigen::VectorXd x = block.points.col(query);
  const auto point = [](const AnswerRef& t) { return t.answers->points.col(t.at); };
  const auto disagree = [&](const std::string& rule) {
    return DescribeDisagreement(block, query, a, b, rule);
  };

  if (!a.found() && !b.found()) return "";
  if (a.found() != b.found()) {
    const double distance = (point(a.found() ? a : b) - x).norm();
    if (!flat || distance > kSurelyInside * block.radii[query]) return "";
    return disagree("an intersection well inside the radius, " + Brief(block.radii[query]) +
                    ", is found by all");
  }
  const double tolerance = AllowedApart(spec, block, query, a, b);
  const double apart = (point(a) - point(b)).norm();
  const double gap = flat ? apart : std::abs((point(a) - x).norm() - (point(b) - x).norm());
  if (gap > tolerance) {
    return disagree(Message(flat ? "the points are " : "the distances differ by ", Brief(gap),
                            flat ? " apart" : "", ", more than the ", Brief(tolerance), " (",
                            kDisagreementTolerance, " epsilon) allowed"));
  }
  if (apart > tolerance) return "";
  const bool both_sizes = a.answers->sizes.size() > 0 && b.answers->sizes.size() > 0;
  if (both_sizes && !core::AreOneSize(a.answers->sizes[a.at], b.answers->sizes[b.at])) {
    return disagree(Message("the sizes there are ", Brief(a.answers->sizes[a.at]), " and ",
                            Brief(b.answers->sizes[b.at]), ", more than a share of ",
                            core::kSameSizeTolerance, " apart"));
  }
  if (const std::string rule = CompareConormals(block.face, x.size(), a, b); !rule.empty())
    return disagree(rule);
  const Index k = spec.dimension;
  const bool both_tangents = a.answers->tangents.size() > 0 && b.answers->tangents.size() > 0;
  if (!both_tangents) return "";
  const double sine = LargestSine(a.answers->tangents.col(a.at).data(),
                                  b.answers->tangents.col(b.at).data(), x.size(), k);
  if (sine <= kTangentDisagreement) return "";
  return disagree(Message("their tangent spaces are turned against each other by an angle of sine ",
                          Brief(sine), ", more than the ", kTangentDisagreement, " allowed"));
}

}  // namespace stellate::server
