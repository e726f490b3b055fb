#include "core/reconstruction/weights.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <set>
#include <unordered_map>
#include <utility>

#include "core/base/interruption.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/reconstruction/weighted_stars.h"

namespace stellate::core {
namespace {

// The limits of y are moved out by this share, so that no weight allowed is on the border.
constexpr double kBeyond = 0.01;
// Intervals shorter than this share of all weights are no choice.
constexpr double kShort = 1e-9;
// Sweeps over all points: most ever, and without fewer simplices to fix.
constexpr int kSweepsOfAll = 40;
constexpr int kVainSweeps = 6;
// Weights chosen for a point before the search gives up, on the average: one does for even points.
constexpr std::size_t kMostChoices = 4;

// Searches weights. Ids are places in `ids`. One point gets its weight after the other, as each
// choice depends on those before; the stars around one point are built in parallel.
template <int K>
class WeightSearch {
 public:
  using Stars = WeightedStars<K>;
  using Simplex = typename Stars::Simplex;
  using Star = typename Stars::Star;
  using Span = typename Stars::Span;

  WeightSearch(const FittedCloud& cloud, const std::vector<std::uint32_t>& ids,
               const std::vector<double>& weights)
      : stars_(cloud, ids, weights) {}

  // Returns the points that got another weight, ascending.
  std::set<std::uint32_t> Run(const std::vector<std::uint32_t>& centres, int sweeps) {
    std::set<std::uint32_t> at;
    for (const std::uint32_t p : centres) {
      at.insert(p);
      for (const Simplex& s : stars_.StarOf(p).simplices) at.insert(s.begin(), s.end());
    }
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      bool fine = true;
      for (const std::uint32_t p : at) {
        ThrowIfInterrupted();
        if (!IsConsistent(p)) fine = false;
      }
      if (fine) break;
      for (const std::uint32_t p : at) {
        ThrowIfInterrupted();
        Improve(p, sweep);
      }
    }
    return changed_;
  }

  // Weighs the points where stars disagree, and then those where they disagree or have slivers.
  // Returns whether all agree. done(share) is called now and then.
  bool RunOnAll(FunctionRef<void(double)> done) {
    stars_.BuildAll();
    for (const bool exudes : {false, true}) {
      exudes_ = exudes;
      std::size_t fewest = std::numeric_limits<std::size_t>::max(), choices = 0;
      int vain = 0;
      for (int sweep = 0; sweep < kSweepsOfAll; ++sweep) {
        std::set<std::uint32_t> at;
        const std::size_t bad = FindBad(&at);
        if (bad == 0 || vain == kVainSweeps) break;
        choices += at.size();
        if (choices > kMostChoices * stars_.size()) break;
        vain = bad < fewest ? 0 : vain + 1;
        fewest = std::min(fewest, bad);
        if (vain > 0)
          for (const std::uint32_t p : std::vector(at.begin(), at.end()))
            for (const Simplex& s : stars_.StarOf(p).simplices) at.insert(s.begin(), s.end());
        for (const std::uint32_t p : at) {
          ThrowIfInterrupted();
          Improve(p, sweep);
        }
        done((exudes ? 0.5 : 0) + 0.5 * sweep / kSweepsOfAll);
      }
      exudes_ = false;
      std::set<std::uint32_t> at;
      if (FindBad(&at) > 0) return false;
    }
    return true;
  }
  double weight(std::uint32_t p) const { return stars_.weight(p); }

 private:
  struct Segment {
    double from, to;
    int bad;
  };

  bool IsConsistent(std::uint32_t p) {
    const Star& star = stars_.StarOf(p);
    for (std::size_t i = 0; i < star.keys.size(); ++i)
      for (const std::uint32_t q : star.simplices[i])
        if (!stars_.Holds(q, star.keys[i])) return false;
    return true;
  }

  bool IsSliver(const Simplex& s, std::uint64_t key) {
    const auto [known, fresh] = slivers_.try_emplace(key, false);
    if (fresh) known->second = stars_.IsSliver(s);
    return known->second;
  }

  // Adds the vertices of all simplices about which stars disagree and, where it exudes, of slivers.
  // Returns the number of (simplex, star) pairs.
  std::size_t FindBad(std::set<std::uint32_t>* at) {
    std::size_t bad = 0;
    for (std::uint32_t p = 0; p < stars_.size(); ++p) {
      ThrowIfInterrupted();
      const Star& star = stars_.StarOf(p);
      for (std::size_t i = 0; i < star.keys.size(); ++i) {
        const Simplex& s = star.simplices[i];
        const bool held = std::all_of(
            s.begin(), s.end(), [&](std::uint32_t q) { return stars_.Holds(q, star.keys[i]); });
        if (held && !(exudes_ && IsSliver(s, star.keys[i]))) continue;
        ++bad;
        at->insert(s.begin(), s.end());
      }
    }
    return bad;
  }

  // Returns between which values of y how much is bad: a simplex in some but not all of its
  // vertices' stars counts 2, a sliver 1 where it exudes. `around`: the stars that depend on y.
  std::vector<Segment> CountBad(const std::vector<std::uint32_t>& around,
                                const std::vector<Span>& spans, double lower, double upper) {
    struct Event {
      double y;
      std::size_t simplex;
      int change;
    };
    std::unordered_map<std::uint64_t, std::size_t> numbers;
    std::vector<int> holders, if_held;
    std::vector<Event> events;
    for (const Span& span : spans) {
      const auto [at, fresh] = numbers.emplace(span.key, holders.size());
      if (fresh) {
        holders.push_back(0);
        if_held.push_back(exudes_ && IsSliver(span.simplex, span.key) ? 1 : 0);
        for (const std::uint32_t v : span.simplex)
          if (std::find(around.begin(), around.end(), v) == around.end())
            holders.back() += stars_.Holds(v, span.key);
      }
      events.push_back({span.from, at->second, 1});
      events.push_back({span.to, at->second, -1});
    }
    std::stable_sort(events.begin(), events.end(),
                     [](const Event& a, const Event& b) { return a.y < b.y; });
    const auto badness = [&](std::size_t s) {
      return holders[s] == 0 ? 0 : holders[s] < K + 1 ? 2 : if_held[s];
    };
    int bad = 0;
    for (std::size_t s = 0; s < holders.size(); ++s) bad += badness(s);
    std::vector<Segment> segments;
    double from = lower;
    const auto close = [&](double to) {
      if (to - from > kShort * (upper - lower)) {
        if (!segments.empty() && segments.back().bad == bad)
          segments.back().to = to;
        else
          segments.push_back({from, to, bad});
      }
      from = to;
    };
    for (const Event& e : events) {
      if (e.y > from) close(e.y);
      bad -= badness(e.simplex);
      holders[e.simplex] += e.change;
      bad += badness(e.simplex);
    }
    close(upper);
    return segments;
  }

  // Gives p the best weight. After the first sweep one that is only as good as the present one is
  // tried, too: it may be better for the neighbours.
  void Improve(std::uint32_t p, int sweep) {
    const double most = stars_.MostWeight(p);
    if (!(most > 0)) return;
    const double g = std::sqrt(most), now = stars_.weight(p);
    const double lower = -(now + kBeyond * most) / (2 * g);
    const double upper = ((1 + kBeyond) * most - now) / (2 * g);
    std::vector<Span> spans;
    const std::vector<std::uint32_t> around = FindAround({p, lower, upper, g}, most, &spans);
    const std::vector<Segment> segments = CountBad(around, spans, lower, upper);
    const Segment* const best = Choose(segments, p, sweep);
    if (!best) return;
    stars_.SetWeight(p, std::clamp(now + g * (best->from + best->to), 0.0, most));
    changed_.insert(p);
    ParallelFor(around.size(), [&](std::size_t i) { stars_.Build(around[i]); });
  }

  // Returns the points in whose stars p is for some weight of its own, p first, and what these
  // stars are.
  std::vector<std::uint32_t> FindAround(const typename Stars::Choice& choice, double most,
                                        std::vector<Span>* spans) {
    const std::uint32_t p = choice.point;
    stars_.BuildForAll(p, choice, spans);
    struct Part {
      bool meets = false;
      std::vector<Span> spans;
    };
    const auto& near = stars_.near(p);
    std::vector<Part> parts(near.size());
    ParallelFor(near.size(), [&](std::size_t i) {
      const auto [distance2, q] = near[i];
      const double most2 = stars_.StarOf(q).most2;
      const double reach = 1.05 * (std::sqrt(most2) + std::sqrt(most2 + most));
      if (distance2 > reach * reach || !stars_.MayMeet(q, choice)) return;
      parts[i].meets = stars_.BuildForAll(q, choice, &parts[i].spans);
    });
    std::vector<std::uint32_t> around{p};
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (!parts[i].meets) continue;
      around.push_back(near[i].second);
      spans->insert(spans->end(), parts[i].spans.begin(), parts[i].spans.end());
    }
    return around;
  }

  static const Segment* Choose(const std::vector<Segment>& segments, std::uint32_t p, int sweep) {
    const Segment *best = nullptr, *present = nullptr;
    for (const Segment& s : segments) {
      if (s.from <= 0 && s.to >= 0) present = &s;
      if (!best || s.bad < best->bad ||
          (s.bad == best->bad && s.to - s.from > best->to - best->from))
        best = &s;
    }
    if (!best || !present || best->bad < present->bad) return best;
    if (present->bad == 0 || sweep == 0) return nullptr;
    std::vector<const Segment*> alike;
    for (const Segment& s : segments)
      if (s.bad == present->bad && &s != present) alike.push_back(&s);
    if (alike.empty()) return nullptr;
    return alike[Mix64((std::uint64_t{p} << 20) + static_cast<std::uint64_t>(sweep)) %
                 alike.size()];
  }

  Stars stars_;
  std::set<std::uint32_t> changed_;
  bool exudes_ = false;                              // whether slivers count
  std::unordered_map<std::uint64_t, bool> slivers_;  // by key
};

}  // namespace

template <int K>
std::vector<std::uint32_t> AddWeights(const FittedCloud& cloud,
                                      const std::vector<std::uint32_t>& ids,
                                      const std::vector<std::uint32_t>& centres, int sweeps,
                                      std::vector<double>* weights) {
  WeightSearch<K> search(cloud, ids, *weights);
  std::vector<std::uint32_t> own;
  own.reserve(centres.size());
  for (const std::uint32_t p : centres)
    own.push_back(
        static_cast<std::uint32_t>(std::lower_bound(ids.begin(), ids.end(), p) - ids.begin()));
  std::vector<std::uint32_t> changed;
  for (const std::uint32_t p : search.Run(own, sweeps)) {
    (*weights)[ids[p]] = search.weight(p);
    changed.push_back(ids[p]);
  }
  return changed;
}

template <int K>
ExudingWeights FindExudingWeights(const FittedCloud& cloud, FunctionRef<void(double)> done) {
  std::vector<std::uint32_t> all(cloud.size);
  std::iota(all.begin(), all.end(), 0u);
  ExudingWeights found;
  found.weights.resize(cloud.size);
  WeightSearch<K> search(cloud, all, found.weights);
  found.agree = search.RunOnAll(done);
  for (std::uint32_t p = 0; p < cloud.size; ++p) found.weights[p] = search.weight(p);
  return found;
}

template ExudingWeights FindExudingWeights<1>(const FittedCloud&, FunctionRef<void(double)>);
template ExudingWeights FindExudingWeights<2>(const FittedCloud&, FunctionRef<void(double)>);
template ExudingWeights FindExudingWeights<3>(const FittedCloud&, FunctionRef<void(double)>);

template std::vector<std::uint32_t> AddWeights<1>(const FittedCloud&,
                                                  const std::vector<std::uint32_t>&,
                                                  const std::vector<std::uint32_t>&, int,
                                                  std::vector<double>*);
template std::vector<std::uint32_t> AddWeights<2>(const FittedCloud&,
                                                  const std::vector<std::uint32_t>&,
                                                  const std::vector<std::uint32_t>&, int,
                                                  std::vector<double>*);
template std::vector<std::uint32_t> AddWeights<3>(const FittedCloud&,
                                                  const std::vector<std::uint32_t>&,
                                                  const std::vector<std::uint32_t>&, int,
                                                  std::vector<double>*);

}  // namespace stellate::core
