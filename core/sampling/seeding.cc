#include "core/sampling/seeding.h"

#include <algorithm>

#include "core/base/interruption.h"
#include "core/base/message.h"
#include "core/base/name_point.h"
#include "core/base/power.h"
#include "core/base/random.h"

namespace stellate::core {
namespace {

// A speculative run that begins from many seeds needs no front: this share of the vertices to come,
// as estimated from the box, within limits by k.
constexpr double kSeedShare = 0.05;
constexpr double kLeastAheadSeeds[kMaxDimension + 1] = {0, 100, 300, 300, 1000, 1000};
constexpr double kMaxSpeculativeSeeds[kMaxDimension + 1] = {0, 100, 1000, 1000, 3000, 3000};

int SpeculativeBoxSeeds(const Specification& spec) {
  const double width = (spec.bounding_box->upper - spec.bounding_box->lower).norm();
  const double vertices = Power(width / spec.epsilon, spec.dimension);
  return static_cast<int>(std::clamp(kSeedShare * vertices, kLeastAheadSeeds[spec.dimension],
                                     kMaxSpeculativeSeeds[spec.dimension]));
}

int SeedsToDraw(const Specification& spec) {
  if (spec.box_seeds > 0) return spec.box_seeds;
  return spec.criteria.speculative ? SpeculativeBoxSeeds(spec) : kDefaultBoxSeeds;
}

}  // namespace

Eigen::MatrixXd SeedsOf(const Specification& spec) {
  if (spec.seeds.cols() > 0) return spec.seeds;
  if (spec.cover_box) return CoverOfBox(spec);
  const BoundingBox& box = *spec.bounding_box;
  Eigen::MatrixXd seeds(spec.ambient_dimension, SeedsToDraw(spec));
  Random random(spec.random_seed);
  for (Eigen::Index i = 0; i < seeds.cols(); ++i)
    for (Eigen::Index j = 0; j < seeds.rows(); ++j)
      seeds(j, i) = box.lower[j] + random.Uniform() * (box.upper[j] - box.lower[j]);
  return seeds;
}

std::string WhyNoSeeds(const Specification& spec, const AnsweredPoints& answers) {
  const auto first = std::find(answers.answered.begin(), answers.answered.end(), 1);
  if (first != answers.answered.end()) {
    const auto count = std::count(first, answers.answered.end(), 1);
    const Eigen::VectorXd point = answers.points.col(first - answers.answered.begin());
    return Message(count, " points of the manifold were found, the first ", NamePoint(point),
                   ", but at none of them does it look ", spec.dimension,
                   "-dimensional: points around it have other closest points than that, or none. "
                   "Correct the dimension, or the closest points");
  }
  const char* const tried =
      spec.seeds.cols() > 0 ? " seeds were" : " points of the bounding box were";
  return Message("no seed has a closest point on the manifold: ", answers.answered.size(), tried,
                 " tried; give seeds near the manifold, or a box that holds it");
}

std::string WhyNothingInside(const Specification& spec, const AnsweredPoints& answers) {
  std::uint64_t found = 0;
  Eigen::Index nearest = 0;  // to the box
  double distance = INFINITY;
  for (Eigen::Index c = 0; c < answers.points.cols(); ++c) {
    const auto i = static_cast<std::size_t>(c);
    CheckInterruption(i);
    if (!answers.found[i] || answers.walls[i] != 0) continue;
    ++found;
    if (!spec.bounding_box) continue;
    const Eigen::VectorXd y = answers.points.col(c);
    const double away =
        (y - y.cwiseMax(spec.bounding_box->lower).cwiseMin(spec.bounding_box->upper)).norm();
    if (away >= distance) continue;
    distance = away;
    nearest = c;
  }
  if (found == 0)
    return "no seed has a closest point on the manifold; give seeds near it, or a box that holds "
           "it";
  if (spec.bounding_box && distance > 0)
    return Message("nothing of the manifold was found in the bounding box, from ",
                   NamePoint(spec.bounding_box->lower), " to ", NamePoint(spec.bounding_box->upper),
                   ": all ", found, " closest points of the seeds lie outside of it, the nearest ",
                   Brief(distance), " away at ", NamePoint(answers.points.col(nearest)),
                   ". Move the box there, or enlarge it");
  return Message("the walls leave nothing of the manifold: all ", found,
                 " closest points of the seeds lie beyond a wall. Is a wall's sign inverted? What "
                 "is inside has clearances >= 0. Or is it empty, a single point, or too small for "
                 "any seed to fall into? Give a seed inside of it");
}

}  // namespace stellate::core
