#include "core/run/round_trip.h"

#include <algorithm>
#include <cmath>

#include "core/base/basis_layout.h"
#include "core/base/parallel.h"
#include "core/base/parallel_copy.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

// Where answers tell tangent spaces, queries lie this share of a simplex's radius, or of the
// lattice's spacing, beside M: far above what the oracle may be wrong by, and so little that the
// answer moves by a hundredth, as the normal there is known to a tenth.
constexpr double kStandOff = 0.1;
// Points planned so many epsilon apart may have any tangent space.
constexpr double kFarPlanned = 3;

}  // namespace

template <int K>
RoundTrip<K>::RoundTrip(const Engine<K>& engine, const OracleCapabilities& oracle,
                        TangentFinder& finder, CandidateSet<K> candidates)
    : engine_(engine),
      policy_(engine.boundary().policy()),
      oracle_(oracle),
      finder_(finder),
      candidates_(std::move(candidates)) {
  const bool alternates =
      !oracle_.intersect_flat && candidates_.planned.size() == 0 && policy_.MayAlternate();
  if (alternates) alternations_left_ = engine_.criteria().flat_alternations - 1;
  FindKnown();
  PlanPoints();
  AskForAll();
}

// Moves queries off M, to the side that it bends away from, where their answers then tell the
// tangent space, too. On the other side one might be so far from its place that M comes by.
template <int K>
void RoundTrip<K>::PlanPoints() {
  const int d = engine_.stars().sample().d();
  const PlannedPoints& planned = candidates_.planned;
  asked_.resize(d, candidates_.size());
  const auto drawn = static_cast<std::size_t>(d * candidates_.drawn());
  ParallelCopy(candidates_.points.data(), drawn, asked_.data());
  ParallelCopy(planned.points.data(), static_cast<std::size_t>(d * planned.size()),
               asked_.data() + drawn);
  if (oracle_.tangent_basis || !finder_.reads_normals()) return;
  const Stars<K>& stars = engine_.stars();
  const std::vector<Target<K>>& targets = candidates_.targets;
  offsets_.setZero(d, candidates_.size());
  ParallelFor(targets.size(), [&](std::size_t i) {
    const Target<K>& t = targets[i];
    if (candidates_.in_flats[i] || t.is_coarse()) return;
    const auto& cell = stars.cell(t.star);
    Eigen::VectorXd bend = Eigen::VectorXd::Zero(d);
    for (std::size_t f = 0; f < cell.facet_count(); ++f)
      if (IsSample(cell.id(f)))
        for (int j = 0; j < d; ++j)
          bend[j] += stars.sample().Point(cell.id(f))[j] - stars.sample().Point(t.star)[j];
    for (Eigen::Index c = candidates_.first[i]; c < candidates_.first[i + 1]; ++c)
      StandOff(c, stars.sample().Tangent(t.star), bend.data(), kStandOff * t.radius);
  });
  ParallelFor(static_cast<std::size_t>(planned.size()), [&](std::size_t at) {
    if (planned.tangents.size() == 0) return;
    const auto i = static_cast<Eigen::Index>(at);
    const double spacing =
        planned.spacing.size() > 0 ? planned.spacing[i] : engine_.criteria().epsilon;
    StandOff(candidates_.drawn() + i, planned.tangents.col(i).data(),
             planned.bends.size() > 0 ? planned.bends.col(i).data() : nullptr, kStandOff * spacing);
  });
  asked_ += offsets_;
}

// Sets the offset of a candidate: along a normal of the tangent space, away from where M bends
// towards.
template <int K>
void RoundTrip<K>::StandOff(Eigen::Index candidate, const double* tangent, const double* towards,
                            double by) {
  const Eigen::Index d = asked_.rows();
  const Eigen::Map<const Eigen::MatrixXd> basis(tangent, d, K);
  const auto across = [&](const Eigen::VectorXd& v) -> Eigen::VectorXd {
    return v - basis * (basis.transpose() * v);
  };
  Eigen::Index axis = 0;
  basis.rowwise().squaredNorm().minCoeff(&axis);
  Eigen::VectorXd normal = across(Eigen::VectorXd::Unit(d, axis));
  if (towards && normal.dot(Eigen::Map<const Eigen::VectorXd>(towards, d)) > 0) normal = -normal;
  offsets_.col(candidate) = by / normal.norm() * normal;
}

// Between a vertex of M and a point beyond a wall lies a point of that wall, and the sample covers
// walls. Therefore a point is inside if its distance from all vertices of the boundary is more than
// its distance from its star's point and the covering radius together. If all are inside, one is
// queried nevertheless: a round is a batch.
template <int K>
void RoundTrip<K>::FindKnown() {
  constexpr double kCovering = 1.25;  // of epsilon: R1 bounds it in tangent spaces, walls bend
  const Stars<K>& stars = engine_.stars();
  const std::vector<Target<K>>& targets = candidates_.targets;
  if (!policy_.FillsSpace() || engine_.criteria().sizes_given) return;
  known_.resize(static_cast<std::size_t>(candidates_.drawn()));
  ParallelFor(targets.size(), [&](std::size_t i) {
    if (targets[i].violation.walls != 0) return;
    for (Eigen::Index c = candidates_.first[i]; c < candidates_.first[i + 1]; ++c) {
      const double* point = candidates_.points.col(c).data();
      const double far = Distance(point, stars.sample().Point(targets[i].star), K) +
                         kCovering * engine_.criteria().epsilon;
      known_[static_cast<std::size_t>(c)] = !stars.sample().boundary_tree().AnyWithin(point, far);
    }
  });
  if (candidates_.planned.size() == 0 && !known_.empty() &&
      std::all_of(known_.begin(), known_.end(), [](std::uint8_t k) { return k != 0; }))
    known_[0] = 0;
}

template <int K>
QueryBlock RoundTrip<K>::NewBlock(QueryKind kind, WallSet face) const {
  QueryBlock block;
  block.kind = kind;
  block.face = face;
  policy_.AddWishes(&block);
  block.want.tangents = oracle_.tangent_basis;
  block.want.sizes = engine_.criteria().sizes_given;
  return block;
}

// Opens a block of flats, one of closest points for each face, and one of the planned points for
// each of their faces, if there are any.
template <int K>
void RoundTrip<K>::AskForAll() {
  if (candidates_.drawn() > 0) AskForDrawn();
  const PlannedPoints& planned = candidates_.planned;
  if (planned.size() == 0) return;
  const auto drawn = static_cast<std::size_t>(candidates_.drawn());
  const auto count = static_cast<std::size_t>(planned.size());
  places_.resize(drawn + count);
  if (planned.walls.empty()) {
    const auto block = static_cast<int>(open_.size());
    open_.push_back(NewBlock(QueryKind::kClosestPoint, 0));
    open_.back().points.resize(asked_.rows(), planned.size());
    ParallelCopy(asked_.col(candidates_.drawn()).data(),
                 static_cast<std::size_t>(planned.points.size()), open_.back().points.data());
    ParallelRanges(count, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        places_[drawn + i] = {block, static_cast<Eigen::Index>(i)};
    });
    return;
  }
  std::vector<WallSet> faces = planned.walls;
  faces.resize(count, 0);
  for (WallSet& face : faces) face = engine_.stars().sample().sectors().labels().Close(face);
  const std::map<WallSet, int> block_of = OpenBlocks(faces);
  std::vector<Eigen::Index> next(open_.size(), 0);
  for (std::size_t i = 0; i < count; ++i) {
    const int block = block_of.at(faces[i]);
    const Eigen::Index column = next[static_cast<std::size_t>(block)]++;
    open_[static_cast<std::size_t>(block)].points.col(column) =
        asked_.col(static_cast<Eigen::Index>(drawn + i));
    places_[drawn + i] = {block, column};
  }
}

// Opens a block of closest points for each face that occurs, ascending, with a column for each of
// its points. Returns the faces' blocks.
template <int K>
std::map<WallSet, int> RoundTrip<K>::OpenBlocks(const std::vector<WallSet>& faces) {
  std::map<WallSet, Eigen::Index> counts;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    CheckInterruption(i);
    ++counts[faces[i]];
  }
  std::map<WallSet, int> block_of;
  for (const auto& [face, count] : counts) {
    block_of[face] = static_cast<int>(open_.size());
    open_.push_back(NewBlock(QueryKind::kClosestPoint, face));
    open_.back().points.resize(engine_.stars().sample().d(), count);
  }
  return block_of;
}

template <int K>
void RoundTrip<K>::AskForDrawn() {
  const Stars<K>& stars = engine_.stars();
  const std::vector<Target<K>>& targets = candidates_.targets;
  Eigen::Index flat_count = 0;
  std::vector<WallSet> faces;  // of the others, by candidate
  for (std::size_t i = 0; i < targets.size(); ++i) {
    CheckInterruption(i);
    for (Eigen::Index c = candidates_.first[i]; c < candidates_.first[i + 1]; ++c) {
      if (IsKnown(c)) continue;
      if (candidates_.in_flats[i])
        ++flat_count;
      else
        faces.push_back(targets[i].violation.walls);
    }
  }
  if (flat_count > 0) {
    QueryBlock flats = NewBlock(QueryKind::kIntersectFlat, 0);
    flats.points.resize(stars.sample().d(), flat_count);
    flats.bases.resize(stars.sample().d() * K, flat_count);
    flats.radii.resize(flat_count);
    open_.push_back(std::move(flats));
  }
  const std::map<WallSet, int> block_of = OpenBlocks(faces);
  std::vector<Eigen::Index> next(open_.size(), 0);
  places_.reserve(static_cast<std::size_t>(candidates_.size()));
  for (std::size_t i = 0; i < targets.size(); ++i) {
    CheckInterruption(i);
    for (Eigen::Index c = candidates_.first[i]; c < candidates_.first[i + 1]; ++c) {
      if (IsKnown(c)) {
        places_.emplace_back(0, 0);
        continue;
      }
      const int block = candidates_.in_flats[i] ? 0 : block_of.at(targets[i].violation.walls);
      places_.emplace_back(block, next[static_cast<std::size_t>(block)]++);
    }
  }
  ParallelFor(targets.size(), [&](std::size_t i) {
    for (Eigen::Index c = candidates_.first[i]; c < candidates_.first[i + 1]; ++c) {
      if (IsKnown(c)) continue;
      const auto [b, column] = places_[static_cast<std::size_t>(c)];
      QueryBlock& block = open_[static_cast<std::size_t>(b)];
      block.points.col(column) = asked_.col(c);
      if (!candidates_.in_flats[i]) continue;
      ToByCoordinate(stars.sample().Tangent(targets[i].star), stars.sample().d(), K,
                     block.bases.col(column).data());
      block.radii[column] = targets[i].radius;
    }
  });
}

template <int K>
std::vector<QueryBlock> RoundTrip<K>::Questions() {
  std::vector<QueryBlock> asked;
  asked.swap(open_);
  asked_faces_.clear();
  for (const QueryBlock& block : asked) asked_faces_.push_back(block.face);
  return asked;
}

template <int K>
void RoundTrip<K>::Absorb(const std::vector<AnswerBlock>& answers) {
  if (finds_tangents_) {
    finder_.Absorb(answers);
    open_ = finder_.Questions();
    if (open_.empty()) TakeTangents();
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
  const int d = engine_.stars().sample().d();
  const Eigen::Index count = candidates_.size();
  const bool sizes_given = engine_.criteria().sizes_given;
  answers_.points.resize(d, count);
  answers_.found.assign(static_cast<std::size_t>(count), 0);
  answers_.tangents.resize(d * K, count);
  answers_.sizes.resize(sizes_given ? count : 0);
  ParallelFor(count, [&](Eigen::Index c) {
    if (c < candidates_.drawn() && IsKnown(c)) return TakeKnown(c);
    const auto i = static_cast<std::size_t>(c);
    const auto [b, column] = places_[i];
    const AnswerBlock& block = answers[static_cast<std::size_t>(b)];
    answers_.found[i] =
        block.found.empty() ? std::uint8_t{1} : block.found[static_cast<std::size_t>(column)];
    answers_.points.col(c) = block.points.col(column);
    if (sizes_given && block.sizes.size() > 0) answers_.sizes[c] = block.sizes[column];
    if (block.tangents.size() > 0)
      ToByVector(block.tangents.col(column).data(), d, K, answers_.tangents.col(c).data());
  });
  if (policy_.TakesClearances()) SortFaces(answers);
}

template <int K>
void RoundTrip<K>::TakeKnown(Eigen::Index c) {
  answers_.found[static_cast<std::size_t>(c)] = 1;
  answers_.points.col(c) = candidates_.points.col(c);
  Eigen::Map<Eigen::Matrix<double, K, K>>(answers_.tangents.col(c).data()).setIdentity();
}

// A known point is in the region of its target's star, with no live wall between the two.
template <int K>
WallSet RoundTrip<K>::SignsOfKnown(Eigen::Index c) const {
  const auto after = std::upper_bound(candidates_.first.begin(), candidates_.first.end(), c);
  const auto i = static_cast<std::size_t>(after - candidates_.first.begin()) - 1;
  return engine_.stars().sample().sectors().Signs(candidates_.targets[i].star);
}

// Sorts the answers about walls.
template <int K>
void RoundTrip<K>::SortFaces(const std::vector<AnswerBlock>& answers) {
  const int d = engine_.stars().sample().d();
  const Eigen::Index count = candidates_.size();
  answers_.walls.assign(static_cast<std::size_t>(count), 0);
  answers_.labels = engine_.stars().sample().sectors().labels();
  if (!answers_.labels.empty()) answers_.signs.assign(static_cast<std::size_t>(count), 0);
  const int walls = policy_.walls();
  answers_.clearances.resize(walls, count);
  int most = K;  // walls of a face
  for (const WallSet face : asked_faces_) most = std::max(most, CountWalls(face));
  answers_.conormals.resize(Eigen::Index{K} * most, count);
  for (Eigen::Index c = 0; c < count; ++c) {
    const auto i = static_cast<std::size_t>(c);
    CheckInterruption(i);
    if (c < candidates_.drawn() && IsKnown(c)) {
      answers_.clearances.col(c).setConstant(INFINITY);  // inside, by an unknown amount
      if (!answers_.labels.empty()) answers_.signs[i] = SignsOfKnown(c);
      continue;
    }
    const auto [b, column] = places_[i];
    const WallSet face = asked_faces_[static_cast<std::size_t>(b)];
    const AnswerBlock& block = answers[static_cast<std::size_t>(b)];
    answers_.walls[i] = face;
    if (!answers_.found[i]) continue;
    answers_.clearances.col(c) = block.clearances.col(column);
    if (!answers_.labels.empty())
      answers_.signs[i] = SignsOf(answers_.clearances.col(c).data(), walls);
    for (int w = 0; w < CountWalls(face); ++w) {
      const double* conormal = block.conormals.col(column).data() + w * d;
      double* const own = answers_.conormals.col(c).data() + w * K;
      double norm2 = 0;
      for (int a = 0; a < K; ++a) {
        own[a] = Dot(answers_.tangents.col(c).data() + a * d, conormal, d);
        norm2 += own[a] * own[a];
      }
      for (int a = 0; a < K; ++a) own[a] /= std::sqrt(norm2);
    }
  }
}

// Goes back to the flat of each candidate, and to M from there.
template <int K>
void RoundTrip<K>::AskAgain() {
  --alternations_left_;
  const int d = engine_.stars().sample().d();
  QueryBlock block = NewBlock(QueryKind::kClosestPoint, 0);
  block.points = answers_.points;
  for (std::size_t i = 0; i < candidates_.targets.size(); ++i) {
    CheckInterruption(i);
    const Target<K>& target = candidates_.targets[i];
    const double* tangent = engine_.stars().sample().Tangent(target.star);
    for (Eigen::Index c = candidates_.first[i]; c < candidates_.first[i + 1]; ++c) {
      if (!answers_.found[static_cast<std::size_t>(c)] || target.violation.fake) continue;
      for (int a = 0; a < K; ++a) {
        const Eigen::Map<const Eigen::VectorXd> t(tangent + a * d, d);
        block.points.col(c) -= t * t.dot(answers_.points.col(c) - candidates_.points.col(c));
      }
    }
  }
  if (offsets_.size() > 0) block.points += offsets_;
  asked_ = block.points;
  open_.push_back(std::move(block));
  for (Eigen::Index c = 0; c < candidates_.size(); ++c)
    places_[static_cast<std::size_t>(c)] = {0, c};
}

// Finds the tangents of the points that were found, with the stars' own tangents as guesses.
template <int K>
void RoundTrip<K>::AskForTangents() {
  std::vector<Eigen::Index> known;
  TangentFinder::Points of;
  const auto add = [&](Eigen::Index c, const double* guess) {
    if (!answers_.found[static_cast<std::size_t>(c)]) return;
    known.push_back(c);
    of.guesses.push_back(guess);
    if (answers_.sizes.size() > 0)
      of.shares.push_back(engine_.sizes().BoundFor(answers_.sizes[c]) / engine_.criteria().epsilon);
  };
  for (std::size_t i = 0; i < candidates_.targets.size(); ++i) {
    CheckInterruption(i);
    // Far steps may turn any corner: no guess there.
    const Target<K>& t = candidates_.targets[i];
    const double* guess = t.is_coarse() ? nullptr : engine_.stars().sample().Tangent(t.star);
    for (Eigen::Index c = candidates_.first[i]; c < candidates_.first[i + 1]; ++c) {
      if (candidates_.in_flats[i]) asked_.col(c) = answers_.points.col(c);  // tells no normal
      add(c, guess);
    }
  }
  const PlannedPoints& planned = candidates_.planned;
  for (Eigen::Index i = 0; i < planned.size(); ++i) {
    const bool is_far = finder_.reads_normals() && planned.spacing.size() > 0 &&
                        planned.spacing[i] > kFarPlanned * engine_.criteria().epsilon;
    add(candidates_.drawn() + i,
        planned.tangents.size() > 0 && !is_far ? planned.tangents.col(i).data() : nullptr);
  }
  if (known.empty()) return;
  of.points = answers_.points(Eigen::all, known);
  of.asked = asked_(Eigen::all, known);
  of.may_leave_out = planned.bends.size() > 0;
  finder_.Start(std::move(of));
  open_ = finder_.Questions();
  finds_tangents_ = !open_.empty();
  if (!finds_tangents_) TakeTangents();
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
