#include "core/speculation/speculative_sampler.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/interruption.h"
#include "core/base/power.h"
#include "core/sampling/growth.h"
#include "core/speculation/speculation.h"

namespace stellate::core {
namespace {

// The epsilon of the coarse mesh, in those of the final one: the surrogate's error grows with its
// fourth power. Denser seeds allow a finer coarse mesh.
constexpr double kLeastCoarse = 2;
constexpr double kMostCoarse = 5;
constexpr double kCoarseStep = 0.8;
constexpr double kShareApart = 0.5;
// So many points determine M well enough; or all seeds, if they are fewer.
constexpr double kEnough[kMaxDimension + 1] = {0, 50, 400, 600, 600, 600};
// Seeds nearer to each other than this share of it add nothing to one of them.
constexpr double kSeedSpacing = 0.5;
// A share of the spacing at which circumradii are mostly below its epsilon: if all are, a round is
// saved.
constexpr double kCoarseSpacing = 0.8;
// The coarse mesh may have holes, which the refinement of the final one fills. For k <= 2 a hole
// costs that more rounds than filling it here takes.
constexpr int kMostRounds = 4;
constexpr double MostBad(int k) { return k <= 2 ? 0.1 : 0.25; }
// If more than this share of the stars is still bad after so many rounds, near the limits of what a
// reach allows, surrogates would be far off. A lattice of dimension 3 that grew ring by ring should
// be almost complete by then.
constexpr int kRoundsBeforeGivingUp = 2;
constexpr double MaxBadShare(int k, bool in_rings) { return in_rings && k > 2 ? MostBad(k) : 0.5; }
// Given seeds may determine next to nothing of M. If more than this share of the stars is bad after
// the sample was grown on their surrogate (with 4 to 32 seeds mostly more are, with hundreds fewer;
// eleven manifolds), the coarse sample grows ring by ring instead, as fine as it may be, since M's
// curvature is unknown. Patches begin as far from each other as those of the final sample.
constexpr double kMaxUnsupportedShare = 0.85;
constexpr double kCoarseApart = kPatchesApart / kLeastCoarse;
// A sample of the most vertices allowed comes from kLeastCoarse^-k times as many coarse ones. If
// the coarse sample is larger by this factor the final one will not fit: curvature accounts for
// less.
constexpr double kCoarseSlack = 1.5;

// Returns the largest epsilon at which enough of the seeds lie that far apart.
double CoarseEpsilon(int k, const AnsweredPoints& seeds, double epsilon) {
  const auto found = static_cast<double>(std::count(seeds.found.begin(), seeds.found.end(), 1));
  const double enough = std::min(kEnough[k], kShareApart * found);
  double coarse = kMostCoarse * epsilon;
  while (kCoarseStep * coarse > kLeastCoarse * epsilon &&
         static_cast<double>(CountApart(seeds, seeds.points.cols(), coarse)) < enough)
    coarse *= kCoarseStep;
  return coarse;
}

// Returns the specification of a coarse mesh for a surrogate: no rule bounds its shapes.
template <int K>
Specification CoarserThan(Specification spec, double epsilon) {
  spec.epsilon = epsilon;
  spec.limits.max_vertices =
      std::min(spec.limits.max_vertices, MaxPointsPerBatch(K, spec.ambient_dimension));
  spec.declared_reach.reset();
  spec.criteria.radius_edge_bound = INFINITY;
  spec.criteria.centre_rule = CentreRule::kTangentSpace;
  spec.criteria.protection = 0;
  if (auto& step = spec.criteria.advance_step) step = std::max(*step, epsilon);
  return spec;
}

template <int K>
AnsweredPoints PointsOf(const Stars<K>& stars) {
  AnsweredPoints answers;
  answers.points = Eigen::Map<const Eigen::MatrixXd>(stars.sample().points().data(),
                                                     stars.sample().d(), stars.size());
  answers.tangents = Eigen::Map<const Eigen::MatrixXd>(stars.sample().Tangent(0),
                                                       stars.sample().d() * K, stars.size());
  answers.found.assign(stars.size(), 1);
  return answers;
}

}  // namespace

template <int K>
SpeculativeSampler<K>::SpeculativeSampler(Engine<K>& engine, const Specification& spec)
    : engine_(engine),
      spec_(spec),
      spacing_(SampleSpacing(K, engine.criteria().epsilon)),
      scouts_(engine.stars().sample().d(), &engine.stars().sample().points()) {}

template <int K>
std::vector<std::uint8_t> SpeculativeSampler<K>::Begin(const AnsweredPoints& seeds) {
  const double epsilon = CoarseEpsilon(K, seeds, engine_.criteria().epsilon);
  const Specification coarse = CoarserThan<K>(spec_, epsilon);
  coarse_ = std::make_unique<Engine<K>>(coarse, Resolve(coarse));
  std::vector<std::uint8_t> used(seeds.found.size(), 0);
  for (std::size_t i = 0; i < used.size(); ++i) {
    CheckInterruption(i);
    const auto c = static_cast<Eigen::Index>(i);
    used[i] =
        seeds.found[i] && !coarse_->is_full() &&
        !coarse_->stars().sample().AnyWithin(seeds.points.col(c).data(), kSeedSpacing * epsilon);
    if (used[i]) coarse_->Append(seeds, c);
  }
  coarse_->Commit();
  return Scout(seeds, used);
}

// Patches begin from the points found: these join the sample immediately, and are all of it if the
// run ends here.
template <int K>
std::vector<std::uint8_t> SpeculativeSampler<K>::Scout(const AnsweredPoints& answers,
                                                       const std::vector<std::uint8_t>& found) {
  std::vector<std::uint8_t> used(found.size(), 0);
  for (std::size_t i = 0; i < found.size(); ++i) {
    CheckInterruption(i);
    const double* const y = answers.points.col(static_cast<Eigen::Index>(i)).data();
    if (!found[i] || engine_.is_full() || scouts_.AnyWithin(y, kPatchesApart * spacing_)) continue;
    engine_.AddToSample(answers, static_cast<Eigen::Index>(i));
    scouts_.Insert(0);
    used[i] = 1;
  }
  return used;
}

template <int K>
double SpeculativeSampler<K>::BadShare() const {
  return static_cast<double>(coarse_->violations().size_and_shape().size()) /
         coarse_->stars().size();
}

// Refines the coarse mesh until R1 mostly holds.
template <int K>
CandidateSet<K> SpeculativeSampler<K>::RefineCoarse(std::uint64_t round) {
  CandidateSet<K> candidates;
  if (rounds_++ == kMostRounds || coarse_->is_full() || BadShare() <= MostBad(K)) return candidates;
  auto targets = coarse_->Plan();
  if (!targets || targets->empty() || targets->front().violation.rule >= Rule::kShape)
    return candidates;
  *targets = coarse_->Select(*targets);
  PlannedPoints planned = RunSpeculatively<K>(*coarse_, round, &*targets, SpeculativeRules::kSizes);
  candidates = coarse_->Draw(std::move(*targets), round);
  candidates.planned = std::move(planned);
  return candidates;
}

// A lattice grown on a surrogate, from `starts` and from those of `others` that no patch comes
// near. It has no more points than a sample may have and, if the surrogate goes on without end, no
// more than twice the number expected.
template <int K>
struct SpeculativeSampler<K>::Grown {
  PlannedPoints planned;
  std::vector<Eigen::Index> begun;  // of the others
};

template <int K>
typename SpeculativeSampler<K>::Grown SpeculativeSampler<K>::Grow(
    Surrogate<K>& guess, double spacing, const AnsweredPoints& starts,
    const AnsweredPoints& others) const {
  const int d = engine_.stars().sample().d();
  const std::uint64_t most = std::min(spec_.limits.max_vertices, 2 * MaxPointsPerBatch(K, d));
  Growth<K> growth(d, spacing);
  std::vector<double> points, tangents;
  Grown grown;
  if (!starts.found.empty()) growth.Begin(starts.points, starts.tangents, starts.found, 0);
  for (bool goes_on = true; goes_on;) {
    while (growth.size() < most) {
      const auto ring = growth.Propose();
      if (ring.points.cols() == 0) break;
      const auto count = static_cast<std::size_t>(ring.points.cols());
      const AnsweredPoints guessed =
          guess.Answer(ring.points, std::vector<const double*>(count, nullptr),
                       Eigen::VectorXd::Constant(ring.points.cols(), spacing));
      for (const Eigen::Index c : growth.Join(guessed.points, guessed.tangents, guessed.found)) {
        CheckInterruption(static_cast<std::size_t>(c));
        const auto point = guessed.points.col(c), tangent = guessed.tangents.col(c);
        points.insert(points.end(), point.begin(), point.end());
        tangents.insert(tangents.end(), tangent.begin(), tangent.end());
      }
    }
    const std::vector<Eigen::Index> begun =
        growth.Begin(others.points, others.tangents, others.found, kPatchesApart * spacing);
    goes_on = !begun.empty();
    grown.begun.insert(grown.begun.end(), begun.begin(), begun.end());
  }
  const auto count = std::ssize(points) / d;
  grown.planned.points = Eigen::Map<const Eigen::MatrixXd>(points.data(), d, count);
  grown.planned.tangents = Eigen::Map<const Eigen::MatrixXd>(tangents.data(), d * K, count);
  return grown;
}

template <int K>
double SpeculativeSampler<K>::coarse_spacing() const {
  return kCoarseSpacing * SampleSpacing(K, coarse_->criteria().epsilon);
}

// Grows the coarse sample, which replaces the seeds, except those that patches begin from. Returns
// nothing if it has fewer points than there are seeds: these then determine too little of M.
template <int K>
PlannedPoints SpeculativeSampler<K>::GrowCoarse() {
  Surrogate<K> guess(coarse_->stars(), coarse_->criteria().advance_step, 0);
  const AnsweredPoints seeds = PointsOf<K>(coarse_->stars());
  Grown grown = Grow(guess, coarse_spacing(), {}, seeds);
  const Eigen::Index count = grown.planned.size();
  if (count == 0 || count + std::ssize(grown.begun) < seeds.points.cols()) return {};
  const Specification coarse = CoarserThan<K>(spec_, coarse_->criteria().epsilon);
  coarse_ = std::make_unique<Engine<K>>(coarse, Resolve(coarse));
  for (const Eigen::Index c : grown.begun)
    if (!coarse_->is_full()) coarse_->AddToSample(seeds, c);
  asked_ = grown.planned.points;
  return std::move(grown.planned);
}

// Returns the grown points with those that R1 and R2 insert if M is as the surrogate predicts: this
// saves one round.
template <int K>
PlannedPoints SpeculativeSampler<K>::RefineGuessed(const PlannedPoints& grown,
                                                   std::uint64_t round) {
  Engine<K> guessed(spec_, engine_.criteria());
  const auto add = [&](const AnsweredPoints& points) {
    for (Eigen::Index c = 0; c < points.points.cols() && !guessed.is_full(); ++c) {
      CheckInterruption(static_cast<std::size_t>(c));
      guessed.AddToSample(points, c);
    }
  };
  AnsweredPoints all = PointsOf<K>(engine_.stars());
  add(all);
  all.points = grown.points;
  all.tangents = grown.tangents;
  add(all);
  guessed.Commit();
  std::vector<Target<K>> targets;
  const PlannedPoints more =
      RunSpeculatively<K>(guessed, round, &targets, SpeculativeRules::kSizes, &*guess_);
  PlannedPoints refined;
  refined.points.resize(grown.points.rows(), grown.size() + more.size());
  refined.points << grown.points, more.points;
  refined.tangents.resize(grown.tangents.rows(), grown.size() + more.size());
  refined.tangents << grown.tangents, more.tangents;
  return refined;
}

template <int K>
PlannedPoints SpeculativeSampler<K>::GrowOnGuesses(std::uint64_t round) {
  const Stars<K>& coarse = coarse_->stars();
  guess_.emplace(coarse, coarse_->criteria().advance_step, 0);
  const AnsweredPoints all = PointsOf<K>(coarse);
  Grown grown = Grow(*guess_, spacing_, PointsOf<K>(engine_.stars()), all);
  for (const Eigen::Index c : grown.begun)
    if (!engine_.is_full()) engine_.AddToSample(all, c);
  return RefineGuessed(grown.planned, round);
}

// Samples the coarse mesh ring by ring, from the points that it has.
template <int K>
void SpeculativeSampler<K>::SampleCoarse() {
  const AnsweredPoints seeds = PointsOf<K>(coarse_->stars());
  Specification coarse = CoarserThan<K>(spec_, kLeastCoarse * engine_.criteria().epsilon);
  coarse.limits.max_vertices = static_cast<std::uint64_t>(std::ceil(
      kCoarseSlack * static_cast<double>(coarse.limits.max_vertices) / Power(kLeastCoarse, K)));
  coarse_ = std::make_unique<Engine<K>>(coarse, Resolve(coarse));
  rings_.emplace(*coarse_, spec_, kCoarseApart);
  rings_->Begin(seeds);
  is_coarse_in_rings_ = true;
  stage_ = Stage::kCoarseRings;
}

// Samples everything ring by ring, from the points of the sample and of the coarse one.
template <int K>
void SpeculativeSampler<K>::GiveUp() {
  rings_.emplace(engine_, spec_);
  rings_->GoOn(PointsOf<K>(engine_.stars()), PointsOf<K>(coarse_->stars()));
  stage_ = Stage::kRings;
}

// Gives up speculation, or samples the coarse mesh in another way, if it is not good enough for a
// surrogate.
template <int K>
void SpeculativeSampler<K>::JudgeCoarse() {
  const double most =
      rounds_ < kRoundsBeforeGivingUp ? kMaxUnsupportedShare : MaxBadShare(K, is_coarse_in_rings_);
  if (BadShare() <= most) return;
  if (spec_.seeds.cols() > 0 && !is_coarse_in_rings_)
    SampleCoarse();
  else if (rounds_ == kRoundsBeforeGivingUp)
    GiveUp();
}

template <int K>
CandidateSet<K> SpeculativeSampler<K>::Next(std::uint64_t round) {
  CandidateSet<K> candidates;
  if (stage_ == Stage::kGuessed) return candidates;
  if (stage_ == Stage::kSeeds) {
    candidates.planned = GrowCoarse();
    stage_ = candidates.size() > 0 ? Stage::kGrown : Stage::kCoarse;
    if (candidates.size() > 0) return candidates;
  }
  if (stage_ == Stage::kGrown) stage_ = Stage::kCoarse;
  if (stage_ == Stage::kCoarse) JudgeCoarse();
  if (stage_ == Stage::kRings) return rings_->Next(round);
  if (stage_ == Stage::kCoarseRings) {
    candidates = rings_->Next(round);
    if (candidates.size() > 0) return candidates;
    if (coarse_->is_full()) {
      GiveUp();
      return rings_->Next(round);
    }
    rings_.reset();
    coarse_->Commit();
    rounds_ = 1;
    stage_ = Stage::kCoarse;
  }
  candidates = RefineCoarse(round);
  if (candidates.size() > 0) return candidates;
  stage_ = Stage::kGuessed;
  candidates.planned = GrowOnGuesses(round);
  asked_ = candidates.planned.points;
  return candidates;
}

template <int K>
std::vector<std::uint8_t> SpeculativeSampler<K>::Take(const CandidateSet<K>& candidates,
                                                      const AnsweredPoints& answers) {
  std::vector<std::uint8_t> used;
  switch (stage_) {
    case Stage::kRings:
      return rings_->Take(candidates, answers);
    case Stage::kGuessed:
      return AddThoseApart(engine_, spacing_, answers);
    case Stage::kCoarseRings:
      used = rings_->Take(candidates, answers);
      break;
    case Stage::kGrown:
      ++rounds_;
      used = AddThoseApart(*coarse_, coarse_spacing(), answers);
      coarse_->Commit();
      break;
    case Stage::kSeeds:
    case Stage::kCoarse:
      used = coarse_->Insert(candidates, answers).used;
      coarse_->Commit();
      break;
  }
  return Scout(answers, used);
}

// Before there is a surrogate: each coarse point begins a patch.
template <int K>
double SpeculativeSampler<K>::CountMissing() const {
  if (stage_ == Stage::kRings) return rings_->CountMissing();
  return guess_ ? static_cast<double>(asked_.cols())
                : Power(kPatchesApart, K) * engine_.stars().size();
}

STELLATE_INSTANTIATE_CLASS(SpeculativeSampler)

}  // namespace stellate::core
