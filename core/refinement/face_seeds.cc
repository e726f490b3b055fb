#include "core/refinement/face_seeds.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/interruption.h"
#include "core/base/vector_ops.h"
#include "core/boundary/inactive_faces.h"
#include "core/refinement/corners.h"

namespace stellate::core {
namespace {

// The distance from the sample, in size bounds, at which a boundary point counts as uncovered. A
// corner, which no other point replaces, counts everywhere except at itself.
constexpr double kNewsAway = 0.5;
// An inactive face of the stage takes a seed at any distance from the sample: it is a small piece
// of walls beside others, without which the mesh would be that of another manifold.
template <int K>
void TakeSeedsOfInactiveFaces(const Stars<K>& stars, int stage,
                              std::vector<typename BoundaryState<K>::Seed>* seeds,
                              std::vector<typename BoundaryState<K>::Seed>* taken) {
  std::erase_if(*seeds, [&](auto& seed) {
    const bool is_taken = std::any_of(taken->begin(), taken->end(),
                                      [&](const auto& other) { return other.walls == seed.walls; });
    if (K - stars.sample().Codimension(seed.walls) != stage || seed.walls == 0 || is_taken ||
        HasPointOn<K>(stars, seed.walls) || stars.EncroachedBy(seed.point.data(), seed.walls))
      return false;
    taken->push_back(std::move(seed));
    return true;
  });
}

}  // namespace

template <int K>
PlannedPoints FaceSeeds<K>::Choose() {
  std::vector<typename BoundaryState<K>::Seed> chosen, left;
  for (auto& seed : engine_.boundary.seeds()) {
    CheckInterruption(chosen.size() + left.size());
    const int dimension = K - engine_.stars.sample().Codimension(seed.walls);
    const double apart = dimension == 0 ? BoundaryState<K>::kSameCorner * engine_.criteria.epsilon
                                        : engine_.criteria.epsilon;
    const bool covered = engine_.stars.sample().AnyWithin(seed.point.data(), apart) ||
                         std::any_of(chosen.begin(), chosen.end(), [&](const auto& other) {
                           return Distance(other.point.data(), seed.point.data(),
                                           engine_.stars.sample().d()) <= apart;
                         });
    const bool ripe = dimension == engine_.boundary.stage() && !covered && !engine_.is_full() &&
                      !engine_.stars.EncroachedBy(seed.point.data(), seed.walls);
    (ripe ? chosen : left).push_back(std::move(seed));
  }
  if (chosen.empty() && !engine_.is_full())
    TakeSeedsOfInactiveFaces<K>(engine_.stars, engine_.boundary.stage(), &left, &chosen);
  engine_.boundary.seeds() = std::move(left);
  if (chosen.empty() && engine_.boundary.stage() == 0 && K > 1 && !engine_.boundary.has_shells())
    return Corners<K>(engine_).PlanShells();
  PlannedPoints points;
  points.points.resize(engine_.stars.sample().d(), static_cast<Eigen::Index>(chosen.size()));
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    points.points.col(static_cast<Eigen::Index>(i)) = chosen[i].point;
    points.walls.push_back(chosen[i].walls);
  }
  return points;
}

template <int K>
AnsweredPoints FaceSeeds<K>::OfInterior() const {
  std::vector<const typename BoundaryState<K>::Seed*> seeds;
  for (const auto& seed : engine_.boundary.seeds())
    if (seed.walls == 0 && seed.tangent.size() > 0) seeds.push_back(&seed);
  AnsweredPoints all;
  const auto count = static_cast<Eigen::Index>(seeds.size());
  all.points.resize(engine_.stars.sample().d(), count);
  all.tangents.resize(engine_.stars.sample().d() * K, count);
  all.answered.assign(seeds.size(), 1);
  all.found = all.answered;
  for (Eigen::Index c = 0; c < count; ++c) {
    all.points.col(c) = seeds[static_cast<std::size_t>(c)]->point;
    all.tangents.col(c) = seeds[static_cast<std::size_t>(c)]->tangent;
  }
  return all;
}

template <int K>
PlannedPoints FaceSeeds<K>::TakeDiscoveries() {
  const auto found = engine_.boundary.TakeDiscoveries();
  PlannedPoints planned;
  const auto count = static_cast<Eigen::Index>(found.size());
  planned.points.resize(engine_.stars.sample().d(), count);
  planned.spacing.resize(count);
  planned.rules.assign(found.size(), Rule::kSize);
  for (std::size_t i = 0; i < found.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    planned.points.col(column) = found[i].point;
    planned.walls.push_back(found[i].walls);
    planned.spacing[column] =
        engine_.criteria.epsilon * (engine_.stars.sample().Codimension(found[i].walls) == K
                                        ? BoundaryState<K>::kSameCorner
                                        : kNewsAway);
  }
  return planned;
}

STELLATE_INSTANTIATE_CLASS(FaceSeeds)

}  // namespace stellate::core
