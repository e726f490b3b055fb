#include "core/run/round_trip.h"

#include "core/base/basis_layout.h"
#include "core/base/parallel.h"

namespace stellate::core {

template <int K>
RoundTrip<K>::RoundTrip(const Engine<K>& engine, const OracleCapabilities& oracle,
                        TangentFinder& finder, CandidateSet<K> candidates)
    : engine_(engine), oracle_(oracle), finder_(finder), candidates_(std::move(candidates)) {
  const bool alternates = !oracle_.intersect_flat && candidates_.planned.size() == 0;
  if (alternates) alternations_left_ = engine_.criteria().flat_alternations - 1;
  AskForAll();
}

template <int K>
QueryBlock RoundTrip<K>::NewBlock(QueryKind kind) const {
  QueryBlock block;
  block.kind = kind;
  block.want_tangents = oracle_.tangent_basis;
  block.want_sizes = engine_.criteria().sizes_given;
  return block;
}

// A block of flats, one of closest points, and one of the planned points, as far as there are any.
template <int K>
void RoundTrip<K>::AskForAll() {
  places_.reserve(static_cast<std::size_t>(candidates_.size()));
  if (candidates_.drawn() > 0) AskForDrawn();
  if (candidates_.planned.size() == 0) return;
  const int block = static_cast<int>(open_.size());
  open_.push_back(NewBlock(QueryKind::kClosestPoint));
  open_.back().points = candidates_.planned.points;
  for (Eigen::Index i = 0; i < candidates_.planned.size(); ++i) places_.emplace_back(block, i);
}

template <int K>
void RoundTrip<K>::AskForDrawn() {
  const StarComplex<K>& complex = engine_.complex();
  const std::vector<Target<K>>& targets = candidates_.targets;
  Eigen::Index flat_count = 0;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    CheckInterruption(i);
    if (candidates_.in_flats[i]) flat_count += candidates_.first[i + 1] - candidates_.first[i];
  }
  const Eigen::Index closest_count = candidates_.drawn() - flat_count;
  const int closest_block = flat_count > 0;
  Eigen::Index next_flat = 0, next_closest = 0;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    CheckInterruption(i);
    for (Eigen::Index c = candidates_.first[i]; c < candidates_.first[i + 1]; ++c)
      places_.push_back(candidates_.in_flats[i] ? std::pair{0, next_flat++}
                                                : std::pair{closest_block, next_closest++});
  }
  QueryBlock flats = NewBlock(QueryKind::kIntersectFlat);
  QueryBlock closest = NewBlock(QueryKind::kClosestPoint);
  flats.points.resize(complex.d(), flat_count);
  flats.bases.resize(complex.d() * K, flat_count);
  flats.radii.resize(flat_count);
  closest.points.resize(complex.d(), closest_count);
  ParallelFor(targets.size(), [&](std::size_t i) {
    for (Eigen::Index c = candidates_.first[i]; c < candidates_.first[i + 1]; ++c) {
      const Eigen::Index column = places_[static_cast<std::size_t>(c)].second;
      if (!candidates_.in_flats[i]) {
        closest.points.col(column) = candidates_.points.col(c);
        continue;
      }
      flats.points.col(column) = candidates_.points.col(c);
      ToByCoordinate(complex.Tangent(targets[i].star), complex.d(), K,
                     flats.bases.col(column).data());
      flats.radii[column] = targets[i].radius;
    }
  });
  if (flat_count > 0) open_.push_back(std::move(flats));
  if (closest_count > 0) open_.push_back(std::move(closest));
}

template <int K>
std::vector<QueryBlock> RoundTrip<K>::Questions() {
  std::vector<QueryBlock> asked;
  asked.swap(open_);
  return asked;
}

template <int K>
void RoundTrip<K>::Absorb(const std::vector<AnswerBlock>& answers) {
  if (finds_tangents_) {
    finder_.Absorb(answers.front());
    if (const QueryBlock* more = finder_.Next())
      open_.push_back(*more);
    else
      TakeTangents();
    return;
  }
  Sort(answers);
  if (alternations_left_ > 0) return AskAgain();
  answers_.answered = answers_.found;
  if (!oracle_.tangent_basis) AskForTangents();
}

// Sorts the answers back into candidates.
template <int K>
void RoundTrip<K>::Sort(const std::vector<AnswerBlock>& answers) {
  const int d = engine_.complex().d();
  const Eigen::Index count = candidates_.size();
  const bool sizes_given = engine_.criteria().sizes_given;
  answers_.points.resize(d, count);
  answers_.found.assign(static_cast<std::size_t>(count), 0);
  answers_.tangents.resize(d * K, count);
  answers_.sizes.resize(sizes_given ? count : 0);
  for (Eigen::Index c = 0; c < count; ++c) {
    const auto i = static_cast<std::size_t>(c);
    CheckInterruption(i);
    const auto [b, column] = places_[i];
    const AnswerBlock& block = answers[static_cast<std::size_t>(b)];
    answers_.found[i] =
        block.found.empty() ? std::uint8_t{1} : block.found[static_cast<std::size_t>(column)];
    answers_.points.col(c) = block.points.col(column);
    if (sizes_given && block.sizes.size() > 0) answers_.sizes[c] = block.sizes[column];
    if (block.tangents.size() > 0)
      ToByVector(block.tangents.col(column).data(), d, K, answers_.tangents.col(c).data());
  }
}

// Back to the flat of each candidate, and to M from there.
template <int K>
void RoundTrip<K>::AskAgain() {
  --alternations_left_;
  const int d = engine_.complex().d();
  QueryBlock block = NewBlock(QueryKind::kClosestPoint);
  block.points = answers_.points;
  for (std::size_t i = 0; i < candidates_.targets.size(); ++i) {
    CheckInterruption(i);
    const Target<K>& target = candidates_.targets[i];
    const double* tangent = engine_.complex().Tangent(target.star);
    for (Eigen::Index c = candidates_.first[i]; c < candidates_.first[i + 1]; ++c) {
      if (!answers_.found[static_cast<std::size_t>(c)] || target.violation.fake) continue;
      for (int a = 0; a < K; ++a) {
        const Eigen::Map<const Eigen::VectorXd> t(tangent + a * d, d);
        block.points.col(c) -= t * t.dot(answers_.points.col(c) - candidates_.points.col(c));
      }
    }
  }
  open_.push_back(std::move(block));
  for (Eigen::Index c = 0; c < candidates_.size(); ++c)
    places_[static_cast<std::size_t>(c)] = {0, c};
}

// Of the points that were found, with the stars' own tangents as guesses.
template <int K>
void RoundTrip<K>::AskForTangents() {
  std::vector<Eigen::Index> known;
  std::vector<const double*> guesses;
  std::vector<double> shares;
  const auto add = [&](Eigen::Index c, const double* guess) {
    if (!answers_.found[static_cast<std::size_t>(c)]) return;
    known.push_back(c);
    guesses.push_back(guess);
    if (answers_.sizes.size() > 0)
      shares.push_back(engine_.sizes().BoundFor(answers_.sizes[c]) / engine_.criteria().epsilon);
  };
  for (std::size_t i = 0; i < candidates_.targets.size(); ++i) {
    CheckInterruption(i);
    // Far steps may turn any corner: no guess there.
    const Target<K>& t = candidates_.targets[i];
    const double* guess = t.is_coarse() ? nullptr : engine_.complex().Tangent(t.star);
    for (Eigen::Index c = candidates_.first[i]; c < candidates_.first[i + 1]; ++c) add(c, guess);
  }
  const PlannedPoints& planned = candidates_.planned;
  for (Eigen::Index i = 0; i < planned.size(); ++i)
    add(candidates_.drawn() + i,
        planned.tangents.size() > 0 ? planned.tangents.col(i).data() : nullptr);
  if (known.empty()) return;
  finds_tangents_ = true;
  finder_.Start(answers_.points(Eigen::all, known), std::move(guesses), std::move(shares));
  open_.push_back(*finder_.Next());
}

template <int K>
void RoundTrip<K>::TakeTangents() {
  Eigen::Index next = 0;
  for (Eigen::Index c = 0; c < candidates_.size(); ++c) {
    auto& found = answers_.found[static_cast<std::size_t>(c)];
    if (!found) continue;
    answers_.tangents.col(c) = finder_.tangents().col(next);
    found = finder_.ok()[static_cast<std::size_t>(next++)];
  }
}

STELLATE_INSTANTIATE_CLASS(RoundTrip)

}  // namespace stellate::core
