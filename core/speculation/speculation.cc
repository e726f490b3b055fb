#include "core/speculation/speculation.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/base/parallel.h"

namespace stellate::core {
namespace {

// R3 and R4 are speculated for this many rounds: what is inconsistent on the surrogate is mostly
// inconsistent on M, but not to the last simplex.
constexpr int kGoodPointRounds = 12;
// A target is dropped if the speculative run has a point within this share of its circumradius.
constexpr double kCovered = 0.9;
// A speculative run that wants this many times the points that seem to be missing is on the wrong
// track.
constexpr double kMostWanted = 4;
// A surrogate of the whole is coarse. Sizes that just hold on it are just above the bound on M:
// therefore points are planned this much finer, instead of fixing the sizes in another round.
constexpr double kShareOfSizes = 0.995;

template <int K>
AnsweredPoints AnswersOf(Surrogate<K>& surrogate, const Stars<K>& stars,
                         const CandidateSet<K>& candidates) {
  std::vector<const double*> flats(static_cast<std::size_t>(candidates.size()), nullptr);
  Eigen::VectorXd spacing(candidates.size());
  for (std::size_t i = 0; i < candidates.targets.size(); ++i) {
    CheckInterruption(i);
    const Target<K>& t = candidates.targets[i];
    for (Eigen::Index c = candidates.first[i]; c < candidates.first[i + 1]; ++c) {
      spacing[c] = t.radius;
      if (candidates.in_flats[i])
        flats[static_cast<std::size_t>(c)] = stars.sample().Tangent(t.star);
    }
  }
  return surrogate.Answer(candidates.points, flats, spacing);
}

// The surrogate has no walls: true points decide near them.
template <int K>
void LeaveWallsAlone(const Stars<K>& stars, double epsilon, std::vector<Target<K>>* targets) {
  if (stars.sample().boundary().empty()) return;
  std::vector<double> aim(static_cast<std::size_t>(stars.sample().d()));
  std::erase_if(*targets, [&, step = std::size_t{0}](const Target<K>& t) mutable {
    CheckInterruption(step++);
    if (t.violation.walls != 0) return true;
    stars.sample().Lift(t.star, t.x, aim.data());
    bool near = false;
    stars.sample().ForEachWithin(aim.data(), t.radius + epsilon, [&](std::uint32_t p) {
      near = near || stars.sample().walls(p) != 0;
    });
    return near;
  });
}

// Returns the rules of the inserted points.
template <int K>
std::vector<Rule> Drive(Engine<K>* speculation, const Engine<K>& original, std::uint64_t round,
                        SpeculativeRules by, Surrogate<K>* known) {
  const double count = original.stars().size();
  const double most = count + kMostWanted * (original.CountMissing(1) + count);
  const ResolvedCriteria& criteria = original.criteria();
  std::optional<Surrogate<K>> own;
  if (!known)
    known = &own.emplace(original.stars(), criteria.advance_step, criteria.epsilon,
                         original.sizes().given());
  std::vector<Rule> rules;
  for (int good_rounds = 0; good_rounds < kGoodPointRounds; ++round) {
    if (speculation->is_full() || speculation->stars().size() > most) break;
    if (by == SpeculativeRules::kSizes && speculation->violations().size_and_shape().empty()) break;
    auto targets = speculation->Plan();
    if (targets) LeaveWallsAlone<K>(speculation->stars(), criteria.epsilon, &*targets);
    if (!targets || targets->empty()) break;
    if (by == SpeculativeRules::kSizes && targets->front().violation.rule >= Rule::kShape) break;
    const CandidateSet<K> candidates = speculation->Draw(speculation->Select(*targets), round);
    good_rounds += candidates.targets.front().violation.rule >= Rule::kShape;
    const Inserted inserted =
        speculation->Insert(candidates, AnswersOf(*known, speculation->stars(), candidates));
    rules.insert(rules.end(), inserted.rules.begin(), inserted.rules.end());
    speculation->Commit();
  }
  return rules;
}

}  // namespace

template <int K>
PlannedPoints RunSpeculatively(const Engine<K>& engine, std::uint64_t round,
                               std::vector<Target<K>>* targets, SpeculativeRules rules,
                               Surrogate<K>* known) {
  Engine<K> speculation = engine.ForSpeculation(known ? kShareOfSizes : 1);
  PlannedPoints planned;
  planned.rules = Drive(&speculation, engine, round, rules, known);
  const Stars<K>& speculated = speculation.stars();
  const Sample<K>& sample = speculated.sample();
  const std::uint32_t count = engine.stars().size();
  const auto wanted = static_cast<Eigen::Index>(speculated.size() - count);
  const int d = sample.d();
  planned.points.resize(d, wanted);
  planned.tangents.resize(d * K, wanted);
  planned.spacing.resize(wanted);
  for (Eigen::Index i = 0; i < wanted; ++i) {
    CheckInterruption(static_cast<std::size_t>(i));
    const std::uint32_t p = count + static_cast<std::uint32_t>(i);
    std::copy_n(sample.Point(p), d, planned.points.col(i).data());
    std::copy_n(sample.Tangent(p), d * K, planned.tangents.col(i).data());
    double nearest2 = INFINITY;
    const auto& cell = speculated.cell(p);
    for (std::size_t f = 0; f < cell.facet_count(); ++f)
      if (IsSample(cell.id(f))) nearest2 = std::min(nearest2, speculated.EdgeLength2(p, f));
    planned.spacing[i] = std::isinf(nearest2) ? engine.criteria().epsilon : std::sqrt(nearest2);
  }
  std::vector<double> centre(static_cast<std::size_t>(d));
  std::erase_if(*targets, [&, step = std::size_t{0}](const Target<K>& t) mutable {
    CheckInterruption(step++);
    engine.stars().sample().Lift(t.star, t.x, centre.data());
    bool covered = false;
    sample.ForEachWithin(centre.data(), kCovered * t.radius,
                         [&](std::uint32_t p) { covered = covered || p >= count; });
    return covered;
  });
  return planned;
}

#define STELLATE_EACH(K)                      \
  template PlannedPoints RunSpeculatively<K>( \
      const Engine<K>&, std::uint64_t, std::vector<Target<K>>*, SpeculativeRules, Surrogate<K>*);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
