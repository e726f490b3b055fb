#include "core/run/laying.h"

#include <algorithm>
#include <cmath>

#include "core/base/interruption.h"
#include "core/growth/lattice.h"
#include "core/run/ahead_laying.h"
#include "core/run/ring_laying.h"
#include "core/sample/ball_tree.h"

namespace stellate::core {
namespace {

// The lattice is laid this much denser than its covering radius asks: curvature stretches it.
constexpr double kSlack = 0.97;
// Seeds are dense where, of those a sample may have, fewer than this share lie so many spacings
// from each other: then the lattice would have no room between them. Of a given sample of dimension
// 3 one in ninety does, and a tenth is where a lattice begins to need fewer vertices, at some
// 1,500.
constexpr double kSparse = 3;
constexpr double SparseShare(int k) { return k < 3 ? 0.5 : 0.1; }
// From 4 on as many seeds as tell enough to guess by are a good part of the sample.
constexpr int kMostAhead = 3;

// Of points and tangents grown ahead: 134 MB.
constexpr std::uint64_t kMostNumbers = 1 << 24;

// About how many points the sample will have, from how far apart half of the seeds lie.
double GuessSize(int k, const AnsweredPoints& seeds, double epsilon) {
  const auto found = static_cast<std::size_t>(std::ranges::count(seeds.found, 1));
  double apart = epsilon;
  std::size_t count = found;
  for (; 2 * count > found && found > 1; apart *= 2)
    count = CountApart(seeds, seeds.points.cols(), 2 * apart);
  return static_cast<double>(count) * std::pow(apart / epsilon, k);
}

// Of seeds drawn to ask ahead from only as many tell as there would be else.
template <int K>
bool AreSparse(const AnsweredPoints& seeds, const Specification& spec, double epsilon) {
  const bool many =
      spec.criteria.ask_ahead && spec.seeds.cols() == 0 && spec.box_seeds == 0 && !spec.cover_box;
  const Eigen::Index most = many ? kDefaultBoxSeeds : seeds.points.cols();
  return static_cast<double>(CountApart(seeds, most, kSparse * LaidSpacing(K, epsilon))) >=
         SparseShare(K) * static_cast<double>(CountApart(seeds, most, epsilon));
}

}  // namespace

std::uint64_t MostAtOnce(int k, int d) {
  return kMostNumbers / (static_cast<std::uint64_t>(d) * static_cast<std::uint64_t>(k + 1));
}

double LaidSpacing(int k, double epsilon) { return kSlack * LatticeSpacing(k) * epsilon; }

std::size_t CountApart(const AnsweredPoints& from, Eigen::Index most, double apart) {
  const auto d = static_cast<int>(from.points.rows());
  std::vector<double> counted;
  BallTree tree(d, &counted);
  for (Eigen::Index c = 0; c < from.points.cols() && most > 0; ++c) {
    CheckInterruption(static_cast<std::size_t>(c));
    if (!from.found[static_cast<std::size_t>(c)]) continue;
    --most;
    const double* const y = from.points.col(c).data();
    if (tree.AnyWithin(y, apart)) continue;
    counted.insert(counted.end(), y, y + d);
    tree.Insert(0);
  }
  return tree.size();
}

template <int K>
std::unique_ptr<Laying<K>> LayingFor(Engine<K>& engine, const Specification& spec,
                                     const AnsweredPoints& seeds) {
  const ResolvedCriteria& criteria = engine.criteria();
  if (criteria.graded() || spec.walls > 0 || (criteria.ask_ahead && K > kMostAhead) ||
      !AreSparse<K>(seeds, spec, criteria.epsilon))
    return nullptr;
  const auto most = static_cast<double>(MostAtOnce(K, engine.complex().d()));
  if (criteria.ask_ahead && GuessSize(K, seeds, criteria.epsilon) <= most)
    return std::make_unique<AheadLaying<K>>(engine, spec);
  return std::make_unique<RingLaying<K>>(engine);
}

#define STELLATE_EACH(K)                                                             \
  template std::unique_ptr<Laying<K>> LayingFor<K>(Engine<K>&, const Specification&, \
                                                   const AnsweredPoints&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
