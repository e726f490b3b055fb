// Which of the speculatively planned points join a sample.

#include <algorithm>
#include <functional>
#include <utility>

#include "core/base/interruption.h"
#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"
#include "core/base/vector_ops.h"
#include "core/index/runs.h"
#include "core/sampling/growth.h"
#include "core/speculation/speculative_sampler.h"

namespace stellate::core {
namespace {

// Answers differ from predictions. Answers nearer to each other than this many spacings would cost
// quality.
constexpr double kKept = 0.6;
// Points of a run lie within this many spacings of its first.
constexpr double kRunReachApart = 3;

// Returns which of the points, `first` of the sample's own and then those queried at `columns`, are
// too near to an earlier one that stays. As predicted they kept their distance: one of two near
// points has moved.
template <int K>
std::vector<std::uint8_t> AreTooNear(const std::vector<double>& points, std::size_t first,
                                     const Eigen::MatrixXd& asked,
                                     const std::vector<Eigen::Index>& columns, double spacing) {
  const auto d = static_cast<int>(asked.rows());
  const auto stride = static_cast<std::size_t>(d);
  const double apart = kKept * spacing;
  const RunTree tree(points, d, kRunReachApart * spacing);
  using Pair = std::pair<std::uint32_t, std::uint32_t>;  // the later one first
  std::vector<Pair> near = ParallelGather<Pair>(columns.size(), [&](std::size_t at, auto* pairs) {
    const auto i = static_cast<std::uint32_t>(first + at);
    const double* const point = points.data() + i * stride;
    if (Distance(point, asked.col(columns[at]).data(), d) <=
        0.5 * (Growth<K>::kKeep * spacing - apart))
      return;
    thread_local std::vector<std::uint32_t> around;
    around.clear();
    tree.Gather(point, apart, &around);
    for (const std::uint32_t j : around)
      if (j != i && SquaredDistance(point, points.data() + j * stride, d) < apart * apart)
        pairs->emplace_back(std::max(i, j), std::min(i, j));
  });
  ParallelSort(near, std::less<>());
  std::vector<std::uint8_t> too_near(points.size() / stride, 0);
  for (std::size_t at = 0; at < near.size(); ++at) {
    CheckInterruption(at);
    const auto [later, earlier] = near[at];
    too_near[later] = too_near[later] || !too_near[earlier];
  }
  return too_near;
}

}  // namespace

template <int K>
std::vector<std::uint8_t> SpeculativeSampler<K>::AddThoseApart(Engine<K>& engine, double spacing,
                                                               const AnsweredPoints& answers) {
  const std::size_t first = engine.stars().size();
  std::vector<double> points = engine.stars().sample().points();
  std::vector<Eigen::Index> found;
  for (std::size_t i = 0; i < answers.found.size(); ++i) {
    CheckInterruption(i);
    if (!answers.found[i]) continue;
    const auto point = answers.points.col(static_cast<Eigen::Index>(i));
    found.push_back(static_cast<Eigen::Index>(i));
    points.insert(points.end(), point.begin(), point.end());
  }
  const std::vector<std::uint8_t> too_near = AreTooNear<K>(points, first, asked_, found, spacing);
  asked_.resize(0, 0);
  std::vector<std::uint8_t> used(answers.found.size(), 0);
  for (std::size_t i = 0; i < found.size() && !engine.is_full(); ++i) {
    CheckInterruption(i);
    if (too_near[first + i]) continue;
    engine.AddToSample(answers, found[i]);
    used[static_cast<std::size_t>(found[i])] = 1;
  }
  return used;
}

#define STELLATE_EACH(K)                                                   \
  template std::vector<std::uint8_t> SpeculativeSampler<K>::AddThoseApart( \
      Engine<K>& engine, double spacing, const AnsweredPoints& answers);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
