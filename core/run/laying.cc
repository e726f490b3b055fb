#include "core/run/laying.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/interruption.h"
#include "core/growth/lattice.h"
#include "core/sample/ball_tree.h"

namespace stellate::core {
namespace {

// The lattice is laid this much denser than its covering radius asks: curvature stretches it.
constexpr double kSlack = 0.97;
// Seeds lie about so many spacings apart: nearer, and seams between patches cost more vertices;
// farther, and the strain within them does.
constexpr double kApart = 10;
// Seeds are dense where, of those a sample may have, fewer than this share lie so many spacings
// from each other: then the lattice would have no room between them. Of a given sample of dimension
// 3 one in ninety does, and a tenth is where a lattice begins to need fewer vertices, at some
// 1,500.
constexpr double kSparse = 3;
constexpr double SparseShare(int k) { return k < 3 ? 0.5 : 0.1; }

double SpacingFor(int k, double epsilon) { return kSlack * LatticeSpacing(k) * epsilon; }

// How many of the points, taken in order, lie `apart` from all taken before.
std::size_t CountApart(const AnsweredPoints& from, double apart) {
  const auto d = static_cast<int>(from.points.rows());
  std::vector<double> taken;
  BallTree tree(d, &taken);
  for (Eigen::Index c = 0; c < from.points.cols(); ++c) {
    CheckInterruption(static_cast<std::size_t>(c));
    const double* const y = from.points.col(c).data();
    if (!from.found[static_cast<std::size_t>(c)] || tree.AnyWithin(y, apart)) continue;
    taken.insert(taken.end(), y, y + d);
    tree.Insert(0);
  }
  return tree.size();
}

void Append(const AnsweredPoints& from, const std::vector<Eigen::Index>& columns,
            AnsweredPoints* to) {
  const auto append = [&](const Eigen::MatrixXd& source, Eigen::MatrixXd* target) {
    const Eigen::Index before = target->cols();
    target->conservativeResize(source.rows(), before + std::ssize(columns));
    for (std::size_t i = 0; i < columns.size(); ++i)
      target->col(before + static_cast<Eigen::Index>(i)) = source.col(columns[i]);
  };
  append(from.points, &to->points);
  append(from.tangents, &to->tangents);
  to->found.resize(to->found.size() + columns.size(), 1);
}

}  // namespace

template <int K>
bool Laying<K>::Suits(const ResolvedCriteria& criteria, const AnsweredPoints& seeds) {
  if (criteria.graded() || criteria.ask_ahead) return false;
  const double sparse = kSparse * SpacingFor(K, criteria.epsilon);
  return static_cast<double>(CountApart(seeds, sparse)) >=
         SparseShare(K) * static_cast<double>(CountApart(seeds, criteria.epsilon));
}

template <int K>
Laying<K>::Laying(Engine<K>& engine)
    : engine_(engine),
      growth_(engine.complex().d(), SpacingFor(K, engine.criteria().epsilon)),
      scouting_(std::make_unique<Growth<K>>(engine.complex().d(), kApart * growth_.spacing())) {}

template <int K>
std::vector<std::uint8_t> Laying<K>::Begin(const AnsweredPoints& seeds) {
  seeds_ = seeds;
  return Scout(seeds,
               scouting_->Begin(seeds.points, seeds.tangents, seeds.found, scouting_->spacing()));
}

template <int K>
std::vector<std::uint8_t> Laying<K>::Lay(const AnsweredPoints& answers,
                                         const std::vector<Eigen::Index>& columns) {
  std::vector<std::uint8_t> used(answers.found.size(), 0);
  for (const Eigen::Index c : columns) {
    CheckInterruption(static_cast<std::size_t>(c));
    if (engine_.is_full()) break;
    engine_.Lay(answers, c);
    used[static_cast<std::size_t>(c)] = 1;
  }
  return used;
}

// What scouts find is of the sample at once: it is what there is if the run ends here.
template <int K>
std::vector<std::uint8_t> Laying<K>::Scout(const AnsweredPoints& answers,
                                           const std::vector<Eigen::Index>& columns) {
  Append(answers, columns, &scouts_);
  return Lay(answers, columns);
}

template <int K>
PlannedPoints Laying<K>::Next() {
  typename Growth<K>::Ring ring;
  // Where all is within reach of one seed there is nothing to scout.
  if (scouting_ && scouting_->size() > 1) ring = scouting_->Propose();
  if (scouting_ && ring.points.cols() == 0) {
    scouting_.reset();
    growth_.Begin(scouts_.points, scouts_.tangents, scouts_.found, 0);
  }
  if (!scouting_ && !engine_.is_full()) {
    ring = growth_.Propose();
    if (ring.points.cols() == 0) {
      // What no patch came near has seeds of its own.
      Lay(seeds_,
          growth_.Begin(seeds_.points, seeds_.tangents, seeds_.found, kApart * growth_.spacing()));
      if (!engine_.is_full()) ring = growth_.Propose();
    }
  }
  PlannedPoints planned;
  planned.points = std::move(ring.points);
  planned.tangents = std::move(ring.tangents);
  return planned;
}

template <int K>
std::vector<std::uint8_t> Laying<K>::Take(const AnsweredPoints& answers) {
  Growth<K>& growth = scouting_ ? *scouting_ : growth_;
  const std::vector<Eigen::Index> joined =
      growth.Join(answers.points, answers.tangents, answers.found);
  return scouting_ ? Scout(answers, joined) : Lay(answers, joined);
}

template <int K>
double Laying<K>::CountMissing() const {
  const double here = 2.0 * static_cast<double>(growth_.border());
  return scouting_ ? here + std::pow(kApart, K) * static_cast<double>(scouting_->size()) : here;
}

STELLATE_INSTANTIATE_CLASS(Laying)

}  // namespace stellate::core
