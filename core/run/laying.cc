#include "core/run/laying.h"

#include <algorithm>
#include <cmath>

#include "core/base/interruption.h"
#include "core/base/power.h"
#include "core/growth/lattice.h"
#include "core/run/ahead_laying.h"
#include "core/run/ring_laying.h"
#include "core/run/solid_laying.h"
#include "core/sample/ball_tree.h"

namespace stellate::core {
namespace {

// The lattice is laid this much denser than its covering radius asks: curvature stretches it.
constexpr double kSlack = 0.97;
// Seeds are dense where, of those a sample may have, fewer than this share lie so many spacings
// from each other: then the lattice would have no room between them. A tenth of those drawn do
// where a surface begins to need a fifth to a third fewer vertices for it, at some 300, and, of a
// given sample of dimension 3, of which one in ninety does, where that does, at some 1,500. Curves
// need fewer only where they take many more rounds.
constexpr double kSparse = 3;
constexpr double SparseShare(int k) { return k < 2 ? 0.5 : 0.1; }
// From 4 on hardly any lie so far from each other where a lattice begins to need fewer vertices:
// what counts is how many more than the seeds there will be, by a guess that is low there. A sphere
// breaks even at some 2,500 vertices, a flat torus below 3,000.
constexpr int kFirstByGuess = 4;
constexpr double kTimesSeeds = 5;
// From 4 on as many seeds as tell enough to guess by are a good part of the sample: it is laid ring
// by ring, and asked ahead for what the rules add.
constexpr int kMostAhead = 3;
// From 4 on there are no fewer vertices between walls, and a cut T^4 that closes without a lattice
// does not with one.
constexpr int kMostBetweenWalls = 3;

// Of points and tangents grown ahead: 134 MB.
constexpr std::uint64_t kMostNumbers = 1 << 24;

// About how many points the sample will have, from how far apart half of the seeds lie.
double GuessSize(int k, const AnsweredPoints& seeds, double epsilon) {
  const auto found = static_cast<std::size_t>(std::ranges::count(seeds.found, 1));
  double apart = epsilon;
  std::size_t count = found;
  for (; 2 * count > found && found > 1; apart *= 2)
    count = CountApart(seeds, seeds.points.cols(), 2 * apart);
  return static_cast<double>(count) * Power(apart / epsilon, k);
}

// Of seeds drawn to ask ahead from only as many tell as there would be else.
template <int K>
bool AreSparse(const Engine<K>& engine, const AnsweredPoints& seeds, const Specification& spec) {
  const double epsilon = engine.criteria().epsilon;
  const Eigen::VectorXd shares = SharesOf(engine.sizes(), seeds);
  const bool many =
      spec.criteria.ask_ahead && spec.seeds.cols() == 0 && spec.box_seeds == 0 && !spec.cover_box;
  const Eigen::Index most = many ? kDefaultBoxSeeds : seeds.points.cols();
  if (K >= kFirstByGuess)
    return GuessSize(K, seeds, epsilon) >=
           kTimesSeeds * static_cast<double>(std::max<std::size_t>(
                             kDefaultBoxSeeds, CountApart(seeds, most, epsilon, shares)));
  return static_cast<double>(CountApart(seeds, most, kSparse * LaidSpacing(K, epsilon), shares)) >=
         SparseShare(K) * static_cast<double>(CountApart(seeds, most, epsilon, shares));
}

// Seeds are no vertices yet there, and in nobody's way.
template <int K>
std::unique_ptr<Laying<K>> LayingBetweenWalls(Engine<K>& engine, const Specification& spec) {
  if (K > kMostBetweenWalls || engine.criteria().graded()) return nullptr;
  if (K == spec.ambient_dimension) return std::make_unique<SolidLaying<K>>(engine);
  return spec.criteria.ask_ahead ? nullptr : std::make_unique<RingLaying<K>>(engine, spec);
}

}  // namespace

std::uint64_t MostAtOnce(int k, int d) {
  return kMostNumbers / (static_cast<std::uint64_t>(d) * static_cast<std::uint64_t>(k + 1));
}

double LaidSpacing(int k, double epsilon) { return kSlack * LatticeSpacing(k) * epsilon; }

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
std::vector<std::uint8_t> LayColumns(Engine<K>& engine, const AnsweredPoints& answers,
                                     const std::vector<Eigen::Index>& columns) {
  std::vector<std::uint8_t> used(static_cast<std::size_t>(answers.points.cols()), 0);
  for (const Eigen::Index c : columns) {
    CheckInterruption(static_cast<std::size_t>(c));
    if (engine.is_full()) break;
    engine.Lay(answers, c);
    used[static_cast<std::size_t>(c)] = 1;
  }
  return used;
}

template <int K>
std::unique_ptr<Laying<K>> LayingFor(Engine<K>& engine, const Specification& spec,
                                     const AnsweredPoints& seeds) {
  const ResolvedCriteria& criteria = engine.criteria();
  if (spec.walls > 0) return LayingBetweenWalls<K>(engine, spec);
  if ((criteria.graded() && (!criteria.sizes_given || criteria.ask_ahead)) ||
      !AreSparse<K>(engine, seeds, spec))
    return nullptr;
  const auto most = static_cast<double>(MostAtOnce(K, engine.stars().sample().d()));
  if (criteria.ask_ahead && K <= kMostAhead && GuessSize(K, seeds, criteria.epsilon) <= most)
    return std::make_unique<AheadLaying<K>>(engine, spec);
  return std::make_unique<RingLaying<K>>(engine, spec);
}

#define STELLATE_EACH(K)                                                              \
  template Eigen::VectorXd SharesOf<K>(const SizeField<K>&, const AnsweredPoints&);   \
  template std::vector<std::uint8_t> LayColumns<K>(Engine<K>&, const AnsweredPoints&, \
                                                   const std::vector<Eigen::Index>&); \
  template std::unique_ptr<Laying<K>> LayingFor<K>(Engine<K>&, const Specification&,  \
                                                   const AnsweredPoints&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
