#include "core/refinement/candidate_set.h"

#include <algorithm>

#include "core/base/instantiate.h"
#include "core/base/parallel.h"
#include "core/base/random.h"

namespace stellate::core {

template <int K>
CandidateSet<K> DrawCandidates(const Stars<K>& stars, const ViolationIndex<K>& violations,
                               const ResolvedCriteria& criteria, const Drawing& drawing,
                               std::vector<Target<K>> targets) {
  CandidateSet<K> set;
  set.targets = std::move(targets);
  set.first.reserve(set.targets.size() + 1);
  set.in_flats.reserve(set.targets.size());
  for (const Target<K>& t : set.targets) {
    CheckInterruption(set.in_flats.size());
    const bool one = t.violation.rule < Rule::kShape;
    set.first.push_back(set.drawn() + (one ? 1 : criteria.candidates));
    set.in_flats.push_back(drawing.from_flats && !t.violation.fake && t.violation.walls == 0 &&
                           !violations.has_no_flat(t.star));
  }
  set.points.resize(stars.sample().d(), set.drawn());
  ParallelFor(set.targets.size(), [&](std::size_t i) {
    const Target<K>& t = set.targets[i];
    Random random(drawing.seed ^ Mix64(stars.sample().NameOf(t.star)), drawing.round);
    const bool has_failed = violations.failed_attempts(t.star) > 0 && !t.is_coarse();
    for (Eigen::Index c = set.first[i]; c < set.first[i + 1]; ++c) {
      double x[K];
      std::copy(t.x, t.x + K, x);
      if (c > set.first[i] || has_failed) {
        double step[K];
        random.UniformInBall<K>(step);
        for (int a = 0; a < K; ++a) x[a] += criteria.picking_radius * t.radius * step[a];
      }
      stars.sample().Lift(t.star, x, set.points.col(c).data());
    }
  });
  return set;
}

#define STELLATE_EACH(K)                                                                \
  template CandidateSet<K> DrawCandidates<K>(const Stars<K>&, const ViolationIndex<K>&, \
                                             const ResolvedCriteria&, const Drawing&,   \
                                             std::vector<Target<K>>);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
