#include "core/run/progress_meter.h"

#include <algorithm>

#include "core/base/instantiate.h"
#include "core/base/parallel.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

// So few points do not measure M's area; more points hardly measure it better.
constexpr std::size_t kFewestKnown = 8, kMostKnown = 64;
// What refinement adds to an initial sample, as long as no rule was tested, and if only R1 and R2
// were.
constexpr double kRefined = 0.25, kCovered = 0.05;
// The rounds of a trend, and the least share of a violation that a vertex fixes.
constexpr std::size_t kLongestTrend = 12, kShortestTrend = 3;
constexpr double kLeastYield = 0.02;
// A fraction that has proved too large by more than this does not foretell the time.
constexpr double kTooLarge = 0.05;
// The certificate's queries (core/certificate/evidence/probes.h): about simplices, at most; at
// vertices, a vertex and at most; others, with all differences that may be needed; those about
// walls. And those of a thorough audit for each simplex.
constexpr double kOfSimplices = 2200, kAtVertices = 0.5, kMostAtVertices = 770, kBesides = 600;
constexpr double kOfWalls = 2000, kThorough = 5;

template <int K>
void CountAll(const Engine<K>& engine, Progress* progress) {
  const Stars<K>& stars = engine.stars();
  const ViolationIndex<K>& violations = engine.violations();
  progress->vertices = stars.size();
  progress->simplices = engine.simplex_count();
  progress->bad_size = progress->bad_radius_edge = progress->unbounded_stars = 0;
  std::size_t step = 0;
  for (const auto& entry : violations.size_and_shape()) {
    CheckInterruption(step++);
    progress->unbounded_stars += !stars.cell(entry.star).bounded();
    ++(entry.violation.rule == Rule::kSize ? progress->bad_size : progress->bad_radius_edge);
  }
  progress->bad_sliver = violations.slivers();
  progress->bad_inconsistent = violations.inconsistent();
  progress->bad_protection = engine.protection().weak();
}

}  // namespace

ProgressMeter::ProgressMeter(const Specification& spec)
    : epsilon_(spec.epsilon),
      is_thorough_(spec.audit == Audit::kThorough),
      has_walls_(spec.walls > 0),
      k_(spec.dimension) {}

void ProgressMeter::Know(const AnsweredPoints& seeds, const std::vector<std::uint8_t>& used) {
  for (Eigen::Index c = 0; c < seeds.points.cols() && known_ < kMostKnown; ++c) {
    const auto i = static_cast<std::size_t>(c);
    if (!seeds.found[i] || used[i]) continue;
    open_.insert(open_.end(), seeds.points.col(c).begin(), seeds.points.col(c).end());
    ++known_;
  }
}

template <int K>
void ProgressMeter::Cover(const Stars<K>& stars) {
  const auto d = static_cast<std::size_t>(stars.sample().d());
  const std::size_t count = open_.size() / d;
  std::vector<std::uint8_t> covered(count, 0);
  const double* const points = stars.sample().points().data();
  ParallelFor(count, [&](std::size_t i) {
    WithDimension(stars.sample().d(), [&](auto known) {
      const int n = known() > 0 ? known() : stars.sample().d();
      const double* const y = open_.data() + i * d;
      for (std::uint32_t v = looked_at_; v < stars.size() && !covered[i]; ++v)
        covered[i] = SquaredDistance(y, points + v * d, n) <= epsilon_ * epsilon_;
    });
  });
  looked_at_ = stars.size();
  std::vector<double> left;
  for (std::size_t i = 0; i < count; ++i)
    if (!covered[i])
      left.insert(left.end(), open_.begin() + static_cast<std::ptrdiff_t>(i * d),
                  open_.begin() + static_cast<std::ptrdiff_t>((i + 1) * d));
  open_ = std::move(left);
}

// The front against M's area, and what refinement adds.
template <int K>
ProgressMeter::Left ProgressMeter::LeftToSample(const Engine<K>& engine, double to_sample) {
  const double have = static_cast<double>(engine.stars().size());
  Left left{to_sample, false};
  if (known_ >= kFewestKnown) {
    const double covered =
        1 - static_cast<double>(open_.size()) /
                static_cast<double>(known_ * static_cast<std::size_t>(engine.stars().sample().d()));
    left.is_known = covered > 0;
    // The sample is near none of them: it covers a small part of M.
    const double least = 0.5 / static_cast<double>(known_);
    left.vertices = have * (1 - covered) / std::max(covered, least);
  }
  left.vertices += kRefined * (have + left.vertices);
  return left;
}

// Estimates by the trend: how many violations each new vertex fixes, beyond those that it adds.
template <int K>
ProgressMeter::Left ProgressMeter::LeftToRefine(const Engine<K>& engine) {
  const ViolationIndex<K>& violations = engine.violations();
  const double have = static_cast<double>(engine.stars().size());
  const double broken = static_cast<double>(violations.size_and_shape().size() +
                                            violations.violating() + engine.protection().weak());
  const bool judges_all = !violations.are_all_dirty();
  if (judges_all != judged_all_) seen_.clear();
  judged_all_ = judges_all;
  seen_.push_back({have, broken});
  if (seen_.size() > kLongestTrend) seen_.pop_front();
  const double later = judges_all ? 0 : kCovered * have;
  if (broken == 0) return {later, true};
  const Seen& then = seen_.front();
  const double yield = have > then.vertices ? (then.broken - broken) / (have - then.vertices) : 0;
  if (seen_.size() > kShortestTrend && yield >= kLeastYield) return {later + broken / yield, true};
  return {std::max(later + engine.CountMissing(0.5) + static_cast<double>(violations.violating()),
                   kRefined * have),
          false};
}

// to_come: vertices, with as many simplices each as those that there are.
double ProgressMeter::QuestionsOfCertificate(const Progress& progress, double to_come) const {
  const auto have = static_cast<double>(progress.vertices);
  const double vertices = have + to_come;
  // As many as a closed manifold has.
  const double simplices = progress.simplices > 0
                               ? static_cast<double>(progress.simplices) * vertices / have
                               : k_ * vertices;
  if (is_thorough_) return kThorough * simplices;
  return std::min(simplices, kOfSimplices) + std::min(kAtVertices * vertices, kMostAtVertices) +
         kBesides + (has_walls_ ? kOfWalls : 0);
}

template <int K>
void ProgressMeter::Measure(const Engine<K>& engine, bool is_certifying, double to_sample,
                            Progress* progress) {
  CountAll<K>(engine, progress);
  const Stars<K>& stars = engine.stars();
  progress->phase = is_certifying       ? Phase::kCertifying
                    : stars.size() == 0 ? Phase::kSeeding
                                        : Phase::kRefining;
  progress->is_foreseeable = false;
  if (stars.size() == 0) return;

  const auto asked = static_cast<double>(progress->queries);
  double left = 0;
  bool is_known = true;
  if (is_certifying) {
    if (before_certificate_ == 0) before_certificate_ = progress->queries;
    left = std::max(QuestionsOfCertificate(*progress, 0) -
                        static_cast<double>(progress->queries - before_certificate_),
                    0.0);
  } else {
    before_certificate_ = 0;
    Cover(stars);
    // Stars that stay open where the sample is near all that is known of M are no front.
    const bool is_covered = known_ >= kFewestKnown && open_.empty();
    const bool grows = to_sample > 0 || (progress->unbounded_stars > 0 && !is_covered);
    const Left vertices =
        grows ? LeftToSample<K>(engine, std::max(to_sample, engine.CountMissing(0.5)))
              : LeftToRefine<K>(engine);
    left = QuestionsOfCertificate(*progress, vertices.vertices) +
           vertices.vertices * std::max(asked / static_cast<double>(stars.size()), 1.0);
    is_known = vertices.is_known;
  }
  const double share = std::min(0.99, asked / (asked + left + 1));
  progress->fraction = std::max(progress->fraction, share);
  progress->is_foreseeable = is_known && share > progress->fraction - kTooLarge;
}

#define STELLATE_EACH(K) \
  template void ProgressMeter::Measure<K>(const Engine<K>&, bool, double, Progress*);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
