#include "core/refinement/independent_set.h"

#include <algorithm>
#include <numeric>

#include "core/base/instantiate.h"
#include "core/base/local_maxima.h"
#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"
#include "core/index/ball_tree.h"

namespace stellate::core {
namespace {

// Longer lists of conflicts are not kept but found again: space is linear in the targets.
constexpr std::uint32_t kMostListed = 48;

template <int K>
double Reach(const Target<K>& t) {
  return t.violation.rule >= Rule::kShape ? 2 * t.radius : t.radius;
}

// The conflicts between targets, each with the stronger ones: those that are taken before it and
// whose conflict balls its insertion point lies in.
template <int K>
class Conflicts {
 public:
  Conflicts(int d, const std::vector<double>& centres, const std::vector<Target<K>>& targets,
            const std::vector<std::uint32_t>& rank)
      : rank_(rank),
        d_(static_cast<std::size_t>(d)),
        chunk_size_(ChunkSize(targets.size())),
        centres_(centres),
        balls_(d, &centres_),
        lists_(ChunkCount(targets.size())),
        spans_(targets.size()) {
    std::vector<double> reaches;
    reaches.reserve(targets.size());
    for (std::size_t i = 0; i < targets.size(); ++i) {
      CheckInterruption(i);
      reaches.push_back(Reach(targets[i]));
    }
    balls_.Assign(std::move(reaches));
    ParallelChunks(targets.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      std::vector<std::uint32_t>& list = lists_[chunk];
      for (std::size_t i = begin; i < end; ++i) {
        Span& span = spans_[i];
        span.begin = static_cast<std::uint32_t>(list.size());
        ForEachStronger(i, [&](std::uint32_t j) {
          if (span.count++ < kMostListed) list.push_back(j);
        });
        if (span.count > kMostListed) list.resize(span.begin);
      }
    });
  }

  // visit(j) for the stronger conflicts of target i, until it returns false.
  template <typename Visit>
  void VisitStronger(std::size_t i, const Visit& visit) const {
    const Span& span = spans_[i];
    if (span.count > kMostListed) {
      bool more = true;
      ForEachStronger(i, [&](std::uint32_t j) { more = more && visit(j); });
      return;
    }
    const std::uint32_t* const list = lists_[i / chunk_size_].data() + span.begin;
    for (std::uint32_t n = 0; n < span.count; ++n)
      if (!visit(list[n])) return;
  }

 private:
  template <typename Visit>
  void ForEachStronger(std::size_t i, const Visit& visit) const {
    balls_.ForEachInfluencing(centres_.data() + i * d_, [&](std::uint32_t j) {
      if (rank_[j] < rank_[i]) visit(j);
    });
  }

  struct Span {
    std::uint32_t begin = 0, count = 0;
  };

  const std::vector<std::uint32_t>& rank_;
  const std::size_t d_;
  const std::size_t chunk_size_;
  const std::vector<double>& centres_;             // by target, d each
  BallTree balls_;                                 // the conflict balls around them
  std::vector<std::vector<std::uint32_t>> lists_;  // by chunk of targets
  std::vector<Span> spans_;                        // by target: its part of the chunk's list
};

}  // namespace

template <int K>
std::vector<double> CentresOf(const Stars<K>& stars, const std::vector<Target<K>>& targets) {
  const auto d = static_cast<std::size_t>(stars.sample().d());
  std::vector<double> centres(targets.size() * d);
  ParallelFor(targets.size(), [&](std::size_t i) {
    stars.sample().Lift(targets[i].star, targets[i].x, centres.data() + i * d);
  });
  return centres;
}

template <int K>
std::vector<std::size_t> SelectIndependent(int d, const std::vector<double>& centres,
                                           const std::vector<Target<K>>& targets,
                                           std::size_t most) {
  std::vector<std::uint32_t> order(targets.size());
  std::iota(order.begin(), order.end(), 0u);
  ParallelSort(order, [&](std::uint32_t i, std::uint32_t j) {
    const Target<K>& a = targets[i];
    const Target<K>& b = targets[j];
    if (a.violation.rule != b.violation.rule) return a.violation.rule < b.violation.rule;
    if (a.radius != b.radius) return a.radius > b.radius;
    return a.star < b.star;
  });
  std::vector<std::uint32_t> rank(targets.size());
  for (std::uint32_t r = 0; r < order.size(); ++r) {
    CheckInterruption(r);
    rank[order[r]] = r;
  }
  const Conflicts<K> conflicts(d, centres, targets, rank);

  const std::vector<std::uint8_t> is_chosen = ChooseLocalMaxima(
      targets.size(), [&](std::size_t i, const auto& visit) { conflicts.VisitStronger(i, visit); });
  std::vector<std::size_t> chosen = ParallelGather<std::size_t>(
      order.size(), [&](std::size_t r, std::vector<std::size_t>* found) {
        if (is_chosen[order[r]]) found->push_back(order[r]);
      });
  chosen.resize(std::min(chosen.size(), most));  // the strongest
  ParallelSort(chosen,
               [&](std::size_t i, std::size_t j) { return targets[i].star < targets[j].star; });
  return chosen;
}

#define STELLATE_EACH(K)                                                                  \
  template std::vector<double> CentresOf(const Stars<K>&, const std::vector<Target<K>>&); \
  template std::vector<std::size_t> SelectIndependent(int, const std::vector<double>&,    \
                                                      const std::vector<Target<K>>&, std::size_t);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
