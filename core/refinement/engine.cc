#include "core/refinement/engine.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"
#include "core/base/power.h"
#include "core/complex/consistency.h"
#include "core/parts/share_out.h"
#include "core/refinement/face_splits.h"
#include "core/refinement/independent_set.h"

namespace stellate::core {
namespace {

// Good points that no longer help: this many times the vertices that R1 and R2 needed.
constexpr double kMostGrowth = 4;
constexpr std::uint64_t kLeastGrowth = 2000;
// If one star in so many is dirty, consistent simplices are found once for all stars.
constexpr std::size_t kMostlyDirty = 2;
// So many stars that follow each other are one part's to judge.
constexpr std::size_t kSharedStars = 32;

// Returns `ids` in an order in which neighbours follow each other: the cache then has what the
// tests of the star before have read.
template <int K>
std::vector<std::uint32_t> InOrderOfPlace(const Stars<K>& stars,
                                          const std::vector<std::uint32_t>& ids) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> places(ids.size());
  ParallelFor(ids.size(), [&](std::size_t i) {
    places[i] = {stars.sample().tree().PlaceOf(ids[i]), static_cast<std::uint32_t>(i)};
  });
  ParallelSort(places, std::less<>());
  std::vector<std::uint32_t> order;
  order.reserve(places.size());
  for (const auto& [place, i] : places) {
    CheckInterruption(order.size());
    order.push_back(i);
  }
  return order;
}

}  // namespace

template <int K>
Engine<K>::Engine(const Specification& spec, const ResolvedCriteria& criteria, const Peers& peers)
    : criteria_(criteria),
      asks_flats_(spec.oracle.intersect_flat),
      random_seed_(spec.random_seed),
      max_vertices_(spec.limits.max_vertices),
      stars_(spec.ambient_dimension, criteria.epsilon, {criteria.inradius, criteria.centre_rule},
             LabelTable(spec.labels, Closures(spec.closures)), peers),
      sizes_(criteria),
      boundary_(BoundaryPolicy(spec), Closures(spec.closures)),
      protection_(criteria.shape.protection) {
  // Sizes are estimated from whole stars.
  if (boundary_.policy().MeshesFacesFirst() && !sizes_.is_estimated()) stars_.RestrictToBoundary();
}

template <int K>
Engine<K> Engine<K>::ForSpeculation(double share) const {
  Engine speculation(*this);
  speculation.caution_ = kSpeculativeCaution;
  speculation.asks_flats_ = true;
  speculation.violations_.ForgetFlats();
  speculation.filled_ = {};
  speculation.criteria_.shape.protection = 0;  // true points only can be protected
  speculation.protection_ = {};
  if (share < 1) {
    speculation.criteria_.epsilon *= share;
    speculation.sizes_ = SizeField<K>(speculation.criteria_);
    speculation.RejudgeAll();
  }
  return speculation;
}

template <int K>
Target<K> Engine<K>::TargetOf(std::uint32_t star, const Violation<K>& violation) const {
  return TargetFor<K>(star, violation, sizes_.BoundAt(stars_, star), criteria_.advance_step,
                      violations_.failed_attempts(star));
}

// A simplex is mostly the worst one in the stars of several of its vertices: the lowest of these
// has the target, unless an attempt from there has failed.
template <int K>
std::vector<Target<K>> Engine<K>::SizeAndShapeTargets() const {
  using Entry = typename ViolationIndex<K>::Entry;
  const std::vector<Entry>& entries = violations_.size_and_shape();
  constexpr std::uint32_t kNone = 0xffffffff;
  std::vector<std::uint32_t> entry_of(stars_.size(), kNone);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    CheckInterruption(i);
    entry_of[entries[i].star] = static_cast<std::uint32_t>(i);
  }
  const auto simplex_of = [&](const Entry& entry, typename Stars<K>::Simplex* simplex) {
    return stars_.SimplexOf(entry.star, stars_.cell(entry.star, entry.violation.sector),
                            entry.violation.vertex, simplex);
  };
  const auto is_seen_from_lower = [&](const Entry& entry) {
    typename Stars<K>::Simplex simplex, other;
    if (!simplex_of(entry, &simplex)) return false;
    for (const std::uint32_t q : simplex) {
      if (q == entry.star) return false;
      if (entry_of[q] != kNone && violations_.failed_attempts(q) == 0 &&
          simplex_of(entries[entry_of[q]], &other) && other == simplex)
        return true;
    }
    return false;
  };
  std::vector<std::uint8_t> is_target(entries.size());
  ParallelFor(entries.size(), [&](std::size_t i) {
    const auto& [star, violation] = entries[i];
    is_target[i] = !violations_.is_given_up(star) && !is_seen_from_lower(entries[i]) &&
                   !IsLeftAlone<K>(stars_, violation, sizes_.BoundAt(stars_, star));
  });
  std::vector<Target<K>> targets;
  targets.reserve(static_cast<std::size_t>(std::count(is_target.begin(), is_target.end(), 1)));
  for (std::size_t i = 0; i < entries.size(); ++i) {
    CheckInterruption(i);
    if (is_target[i]) targets.push_back(TargetOf(entries[i].star, entries[i].violation));
  }
  return targets;
}

template <int K>
void Engine<K>::RejudgeAll() {
  std::vector<std::uint32_t> all(stars_.size());
  std::iota(all.begin(), all.end(), 0u);
  violations_.Replace(JudgeSizeAndShape(all));
}

template <int K>
std::vector<typename ViolationIndex<K>::Entry> Engine<K>::JudgeSizeAndShape(
    const std::vector<std::uint32_t>& stars) const {
  using Entry = typename ViolationIndex<K>::Entry;
  return ParallelGather<Entry>(stars.size(), [&](std::size_t i, std::vector<Entry>* found) {
    const std::uint32_t p = stars[i];
    if (const auto worst =
            WorstSizeOrShape<K>(stars_, p, sizes_.BoundAt(stars_, p), criteria_.radius_edge_bound,
                                boundary_.stage(), boundary_.left() + 1))
      found->push_back({p, *worst});
  });
}

template <int K>
std::vector<Target<K>> Engine<K>::GoodPointTargets() {
  if (violations_.are_all_dirty()) before_good_points_ = stars_.size();
  const std::vector<std::uint32_t> dirty = violations_.TakeDirty(filled_.resolved());
  std::vector<std::optional<Violation<K>>> found(dirty.size());
  const std::vector<std::uint32_t> near = InOrderOfPlace<K>(stars_, dirty);
  std::optional<ConsistentSimplices<K>> consistent;
  if (kMostlyDirty * dirty.size() >= stars_.size()) consistent.emplace(stars_);
  const auto judge = [&](std::size_t i) {
    const std::uint32_t p = dirty[near[i]];
    found[near[i]] = WorstSliverOrInconsistent<K>(
        stars_, p, criteria_.shape, sizes_.BoundAt(stars_, p), boundary_.stage(),
        consistent ? consistent->Of(p) : 0, boundary_.left() + 1);
  };
  ShareOut(
      stars_.peers(), dirty.size(), kSharedStars, judge,
      [&](std::size_t i, Peers::Bytes* message) { Pack(found[near[i]], message); },
      [&](std::size_t i, Parcel* parcel) { parcel->Unpack(1, &found[near[i]]); });
  filled_.ForgetResolved();
  if (boundary_.stage() == K &&
      std::any_of(found.begin(), found.end(), [](const auto& v) { return v.has_value(); }))
    filled_.Fill(stars_, criteria_);
  else
    filled_.Clear();
  const FaceSplits<K> face_splits(parts());
  std::vector<Target<K>> targets;
  for (std::size_t i = 0; i < dirty.size(); ++i) {
    CheckInterruption(i);
    const std::uint32_t p = dirty[i];
    const bool is_resolved = found[i] && filled_.Resolves(stars_, p, *found[i]);
    if (is_resolved) filled_.NoteResolved(p);
    // A simplex that is tilted or sharp cannot always be removed, nor a sliver between faces that
    // are nearer to each other than their sizes: the certificate reports these.
    const bool may_stay = found[i] && (found[i]->tilted || found[i]->sharp ||
                                       face_splits.IsSliverAtBoundary(p, *found[i]));
    if (!found[i] || is_resolved || (may_stay && violations_.is_given_up(p))) {
      violations_.NoteJudged(p, std::nullopt);
      continue;
    }
    violations_.NoteJudged(p, found[i]->rule);
    if (violations_.is_given_up(p) || IsLeftAlone<K>(stars_, *found[i], sizes_.BoundAt(stars_, p)))
      continue;
    const auto split = face_splits.Under(p, *found[i]);
    targets.push_back(split ? *split : TargetOf(p, *found[i]));
  }
  return targets;
}

template <int K>
std::vector<Target<K>> Engine<K>::ProtectionTargets() {
  std::vector<Target<K>> targets;
  for (const auto& [star, violation] : protection_.Judge(stars_)) {
    CheckInterruption(targets.size());
    if (!violations_.is_given_up(star)) targets.push_back(TargetOf(star, violation));
  }
  if (protection_.is_given_up()) criteria_.shape.protection = 0;
  return targets;
}

template <int K>
bool Engine<K>::HasGrownTooMuch() const {
  if (violations_.are_all_dirty()) return false;
  const double most = std::max(kMostGrowth * static_cast<double>(before_good_points_),
                               static_cast<double>(before_good_points_ + kLeastGrowth));
  return static_cast<double>(stars_.size()) > most;
}

template <int K>
std::optional<std::vector<Target<K>>> Engine<K>::Plan() {
  if (HasGrownTooMuch()) {
    if (criteria_.shape.sharpest_cosine < 1) {  // what it grew for: a mesh is worth more
      criteria_.shape.sharpest_cosine = 1;
      before_good_points_ = stars_.size();
    } else if (std::isfinite(criteria_.shape.reach)) {
      criteria_.shape.reach = INFINITY;  // unproved, but a mesh
    } else {
      return std::nullopt;
    }
  }
  std::vector<Target<K>> targets = SizeAndShapeTargets();
  if (sizes_.NeedsSpreading(stars_, targets.empty())) {
    // A star's bound also follows its neighbours, whose sizes may have changed after it was judged.
    sizes_.Spread(stars_);
    RejudgeAll();
    targets = SizeAndShapeTargets();
  }
  if (targets.empty()) targets = GoodPointTargets();
  if (targets.empty() && protection_.is_asked() && AllRulesHold()) targets = ProtectionTargets();
  const bool any = !targets.empty();
  FaceSplits<K>(parts()).Yield(&targets);
  if (any && targets.empty()) return Plan();  // all were refused, which is not done forever
  return targets;
}

template <int K>
bool Engine<K>::AllRulesHold() const {
  const auto& entries = violations_.size_and_shape();
  return boundary_.left() == 0 && violations_.violating() == 0 &&
         std::all_of(entries.begin(), entries.end(), [&](const auto& entry) {
           return filled_.Resolves(stars_, entry.star, entry.violation);
         });
}

template <int K>
std::vector<Target<K>> Engine<K>::Select(const std::vector<Target<K>>& targets) const {
  const std::vector<std::size_t> chosen = SelectIndependent<K>(
      stars_.sample().d(), CentresOf<K>(stars_, targets), targets, max_vertices_ - stars_.size());
  std::vector<Target<K>> selected;
  selected.reserve(chosen.size());
  for (const std::size_t i : chosen) {
    CheckInterruption(selected.size());
    selected.push_back(targets[i]);
  }
  return selected;
}

template <int K>
CandidateSet<K> Engine<K>::Draw(std::vector<Target<K>> targets, std::uint64_t round) const {
  return DrawCandidates<K>(stars_, violations_, criteria_, {asks_flats_, random_seed_, round},
                           std::move(targets));
}

template <int K>
Inserter<K> Engine<K>::InserterOf(const CandidateSet<K>& candidates,
                                  const AnsweredPoints& answers) {
  return {parts(), candidates, answers, caution_};
}

template <int K>
Inserted Engine<K>::Insert(const CandidateSet<K>& candidates, const AnsweredPoints& answers) {
  return InserterOf(candidates, answers).Run();
}

template <int K>
void Engine<K>::Append(const AnsweredPoints& answers, Eigen::Index c) {
  stars_.Add(answers.points.col(c).data(), answers.tangents.col(c).data(), Stars<K>::kNone,
             answers.WallsOf(c), answers.ConormalsOf(c), answers.SignsOf(c));
  if (answers.sizes.size() > 0) sizes_.AppendGiven(answers.sizes[c]);
}

template <int K>
void Engine<K>::AddToSample(const AnsweredPoints& answers, Eigen::Index c) {
  double bound = 0;
  if (answers.sizes.size() > 0) {
    sizes_.AppendGiven(answers.sizes[c]);
    bound = sizes_.BoundFor(answers.sizes[c]);
  }
  stars_.AddInBulk(answers.points.col(c).data(), answers.tangents.col(c).data(), bound);
}

template <int K>
typename Engine<K>::Change Engine<K>::Commit() {
  const std::uint32_t first = violations_.star_count();
  const bool judged = !violations_.are_all_dirty();
  std::vector<std::uint32_t> around;
  Change change = stars_.Commit(judged ? &around : nullptr);
  std::vector<std::uint32_t>& touched = change.stars;
  touched.resize(touched.size() + stars_.size() - first);
  std::iota(touched.end() - (stars_.size() - first), touched.end(), first);
  if (sizes_.is_estimated()) sizes_.Look(stars_, touched);
  violations_.Update(stars_.size(), touched, JudgeSizeAndShape(touched));
  if (protection_.is_asked()) protection_.Note(stars_, touched, first);
  if (judged) {
    violations_.MarkDirty(around);
    violations_.MarkDirty(touched);
  }
  return change;
}

template <int K>
void Engine<K>::MarkAllDirty() {
  violations_.MarkAllDirty();
  filled_.ForgetResolved();
}

template <int K>
double Engine<K>::CountMissing(double share) const {
  double missing = 0;
  std::size_t step = 0;
  for (const auto& entry : violations_.size_and_shape()) {
    CheckInterruption(step++);
    const double ratio = entry.violation.radius / sizes_.BoundAt(stars_, entry.star);
    missing += share * Power(std::max(ratio, 1.0), K);
  }
  return missing;
}

template <int K>
std::vector<std::uint32_t> Engine<K>::Simplices() const {
  return filled_.is_handed_out() ? filled_.cavities().simplices : stars_.Simplices();
}

template <int K>
std::uint64_t Engine<K>::simplex_count() const {
  return filled_.is_handed_out() ? filled_.cavities().simplices.size() / (K + 1)
                                 : stars_.simplex_count();
}

STELLATE_INSTANTIATE_CLASS(Engine)

}  // namespace stellate::core
