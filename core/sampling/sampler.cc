#include "core/sampling/sampler.h"

#include <algorithm>
#include <cmath>

#include "core/base/interruption.h"
#include "core/index/ball_tree.h"
#include "core/sampling/lattice.h"

namespace stellate::core {
namespace {

// The lattice is this much denser than its covering radius requires: curvature stretches it.
constexpr double kSlack = 0.97;
// The most numbers of points and tangents that are grown before they are queried: 134 MB.
constexpr std::uint64_t kMostNumbers = 1 << 24;

}  // namespace

std::uint64_t MaxPointsPerBatch(int k, int d) {
  return kMostNumbers / (static_cast<std::uint64_t>(d) * static_cast<std::uint64_t>(k + 1));
}

double SampleSpacing(int k, double epsilon) { return kSlack * LatticeSpacing(k) * epsilon; }

template <int K>
Eigen::VectorXd SharesOf(const SizeField<K>& sizes, const AnsweredPoints& answers) {
  Eigen::VectorXd shares = Eigen::VectorXd::Ones(answers.sizes.size());
  for (Eigen::Index c = 0; c < shares.size(); ++c)
    if (answers.found[static_cast<std::size_t>(c)])
      shares[c] = sizes.BoundFor(answers.sizes[c]) / sizes.BoundFor(INFINITY);
  return shares;
}

std::size_t CountApart(const AnsweredPoints& from, Eigen::Index most, double apart,
                       const Eigen::VectorXd& shares) {
  const auto d = static_cast<int>(from.points.rows());
  std::vector<double> counted;
  BallTree tree(d, &counted);
  for (Eigen::Index c = 0; c < from.points.cols() && most > 0; ++c) {
    CheckInterruption(static_cast<std::size_t>(c));
    if (!from.found[static_cast<std::size_t>(c)]) continue;
    --most;
    const double* const y = from.points.col(c).data();
    if (tree.AnyWithin(y, shares.size() > 0 ? shares[c] * apart : apart)) continue;
    counted.insert(counted.end(), y, y + d);
    tree.Insert(0);
  }
  return tree.size();
}

template <int K>
std::vector<std::uint8_t> AddToSample(Engine<K>& engine, const AnsweredPoints& answers,
                                      const std::vector<Eigen::Index>& columns) {
  std::vector<std::uint8_t> used(static_cast<std::size_t>(answers.points.cols()), 0);
  for (const Eigen::Index c : columns) {
    CheckInterruption(static_cast<std::size_t>(c));
    if (engine.is_full()) break;
    engine.AddToSample(answers, c);
    used[static_cast<std::size_t>(c)] = 1;
  }
  return used;
}

#define STELLATE_EACH(K)                                                               \
  template Eigen::VectorXd SharesOf<K>(const SizeField<K>&, const AnsweredPoints&);    \
  template std::vector<std::uint8_t> AddToSample<K>(Engine<K>&, const AnsweredPoints&, \
                                                    const std::vector<Eigen::Index>&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
