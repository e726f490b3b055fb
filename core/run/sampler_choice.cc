#include "core/run/sampler_choice.h"

#include <algorithm>
#include <cmath>

#include "core/base/power.h"
#include "core/sampling/ring_sampler.h"
#include "core/sampling/solid_sampler.h"
#include "core/speculation/speculative_sampler.h"

namespace stellate::core {
namespace {

// Seeds are dense if, of those that a sample may have, fewer than this share lie so many spacings
// from each other: the lattice would then not fit between them. A lattice saves a surface a fifth
// to a third of its vertices from some 300 vertices on, where a tenth of the drawn seeds lie so far
// apart, and a given sample of dimension 3 from some 1,500 on, where one in ninety does. Curves
// need fewer vertices only if they take many more rounds.
constexpr double kSparse = 3;
constexpr double SparseShare(int k) { return k < 2 ? 0.5 : 0.1; }
// From k = 4 on hardly any seeds lie so far apart where a lattice begins to save vertices: there
// the criterion is how many more vertices than seeds there will be, by an estimate that is low. A
// sphere breaks even at some 2,500 vertices, a flat torus below 3,000.
constexpr int kFirstByGuess = 4;
constexpr double kTimesSeeds = 5;
// From k = 4 on, the seeds that a surrogate needs are a large part of the sample: it grows ring by
// ring, and only the points that the rules add are speculative.
constexpr int kMaxSpeculativeDimension = 3;
// From k = 4 on a lattice saves no vertices between walls, and a cut T^4 that closes without a
// lattice does not close with one.
constexpr int kMostBetweenWalls = 3;

// Estimates how many points the sample will have, from how far apart half of the seeds lie.
double GuessSize(int k, const AnsweredPoints& seeds, double epsilon) {
  const auto found = static_cast<std::size_t>(std::ranges::count(seeds.found, 1));
  double apart = epsilon;
  std::size_t count = found;
  for (; 2 * count > found && found > 1; apart *= 2)
    count = CountApart(seeds, seeds.points.cols(), 2 * apart);
  return static_cast<double>(count) * Power(apart / epsilon, k);
}

// Of the seeds drawn for a speculative run only as many count as another run would draw.
template <int K>
bool AreSparse(const Engine<K>& engine, const AnsweredPoints& seeds, const Specification& spec) {
  const double epsilon = engine.criteria().epsilon;
  const Eigen::VectorXd shares = SharesOf(engine.sizes(), seeds);
  const bool many =
      spec.criteria.speculative && spec.seeds.cols() == 0 && spec.box_seeds == 0 && !spec.cover_box;
  const Eigen::Index most = many ? kDefaultBoxSeeds : seeds.points.cols();
  if (K >= kFirstByGuess)
    return GuessSize(K, seeds, epsilon) >=
           kTimesSeeds * static_cast<double>(std::max<std::size_t>(
                             kDefaultBoxSeeds, CountApart(seeds, most, epsilon, shares)));
  return static_cast<double>(
             CountApart(seeds, most, kSparse * SampleSpacing(K, epsilon), shares)) >=
         SparseShare(K) * static_cast<double>(CountApart(seeds, most, epsilon, shares));
}

// Between walls seeds are no vertices yet, and in no point's way.
template <int K>
std::unique_ptr<Sampler<K>> SamplerBetweenWalls(Engine<K>& engine, const Specification& spec) {
  if (K > kMostBetweenWalls || engine.criteria().graded() || !spec.labels.empty()) return nullptr;
  if (K == spec.ambient_dimension) return std::make_unique<SolidSampler<K>>(engine);
  return spec.criteria.speculative ? nullptr : std::make_unique<RingSampler<K>>(engine, spec);
}

}  // namespace

template <int K>
std::unique_ptr<Sampler<K>> SamplerFor(Engine<K>& engine, const Specification& spec,
                                       const AnsweredPoints& seeds) {
  const ResolvedCriteria& criteria = engine.criteria();
  if (engine.boundary().policy().MeshesFacesFirst()) return SamplerBetweenWalls<K>(engine, spec);
  if ((criteria.graded() && (!criteria.sizes_given || criteria.speculative)) ||
      !AreSparse<K>(engine, seeds, spec))
    return nullptr;
  const auto most = static_cast<double>(MaxPointsPerBatch(K, engine.stars().sample().d()));
  if (criteria.speculative && K <= kMaxSpeculativeDimension &&
      GuessSize(K, seeds, criteria.epsilon) <= most)
    return std::make_unique<SpeculativeSampler<K>>(engine, spec);
  return std::make_unique<RingSampler<K>>(engine, spec);
}

#define STELLATE_EACH(K)                                                               \
  template std::unique_ptr<Sampler<K>> SamplerFor<K>(Engine<K>&, const Specification&, \
                                                     const AnsweredPoints&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
