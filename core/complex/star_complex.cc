#include "core/complex/star_complex.h"

#include <algorithm>
#include <functional>
#include <iterator>

#include "core/geometry/common_centre.h"
#include "core/parallel.h"

namespace stellate::core {

namespace {

// The point itself, and as many neighbours as close a cell.
template <int K>
inline constexpr int kNearestFirst = 2 * K + 3;

// Simplices of a larger circumradius, in epsilon, are judged in the flats: far out the common
// centre is no better, and they will be refined anyway.
constexpr double kJudgedRadius = 1.3;

// One a thread, for the life of the thread.
template <int K>
typename RestrictedVoronoiCell<K>::Scratch& ThreadScratch() {
  thread_local typename RestrictedVoronoiCell<K>::Scratch scratch;
  return scratch;
}

// Room for q - p, on the stack where d is small.
class Step {
 public:
  explicit Step(int d) {
    if (d > kSmall) heap_.resize(static_cast<std::size_t>(d));
  }
  double* data() { return heap_.empty() ? stack_ : heap_.data(); }

 private:
  static constexpr int kSmall = 16;
  double stack_[kSmall];
  std::vector<double> heap_;
};

}  // namespace

template <int K>
StarComplex<K>::StarComplex(int d, double epsilon, double inradius, Judging judging)
    : d_(d),
      inradius_(inradius),
      judging_(judging),
      judged_radius2_(kJudgedRadius * kJudgedRadius * epsilon * epsilon),
      weight_scale_(1e-10 * epsilon * epsilon),
      tree_(d, &points_) {}

template <int K>
StarComplex<K>::StarComplex(const StarComplex& other)
    : d_(other.d_),
      inradius_(other.inradius_),
      judging_(other.judging_),
      judged_radius2_(other.judged_radius2_),
      weight_scale_(other.weight_scale_),
      points_(other.points_),
      tangents_(other.tangents_),
      cells_(other.cells_),
      tree_(other.tree_, &points_),
      simplex_count_(other.simplex_count_) {}

// What the cell of p may ask.
template <int K>
class StarComplex<K>::Around final : public Surroundings<K> {
 public:
  Around(const StarComplex& complex, const Site& p, const Site* guest,
         const Site* newcomer = nullptr, const Cell* born = nullptr)
      : complex_(complex), p_(p), guest_(guest), newcomer_(newcomer), born_(born) {}

  double HalfSpace(std::uint32_t id, double* normal) const override {
    if (IsFake(id))
      return FakeHalfSpace<K>(static_cast<int>(id - kFirstFakeId), complex_.inradius_, normal);
    Step step(complex_.d_);
    return complex_.HalfSpace(p_, Find(id), step.data(), normal);
  }

  int judged_in() const override { return complex_.judging_ == Judging::kFlats ? 0 : complex_.d_; }

  bool Centre(const std::uint32_t* ids, std::uint64_t key, double* x,
              double* centre) const override {
    if (!(born_ && Known(key, centre)) && !Common(ids, centre)) return false;
    const int n = complex_.d_;
    for (int a = 0; a < K; ++a) x[a] = Dot(p_.tangent + a * n, centre, n);
    return true;
  }

  void Lift(const double* x, double* centre) const override {
    const int n = complex_.d_;
    std::fill(centre, centre + n, 0.0);
    for (int a = 0; a < K; ++a)
      for (int i = 0; i < n; ++i) centre[i] += x[a] * p_.tangent[a * n + i];
  }

 private:
  Site Find(std::uint32_t id) const {
    return id == p_.id ? p_ : guest_ && id == guest_->id ? *guest_ : complex_.At(id);
  }

  // The centre from the newcomer's star, which all simplices of the vertices that it creates are in
  // if they are consistent.
  bool Known(std::uint64_t key_in_p, double* centre) const {
    const std::uint64_t key = key_in_p + Mix64(p_.id) - Mix64(newcomer_->id);
    const std::size_t v = born_->Find(key);
    if (v == born_->vertex_count() || !born_->judged(v)) return false;
    const double* const there = born_->Centre(v);
    for (int j = 0; j < complex_.d_; ++j)
      centre[j] = there[j] + (newcomer_->point[j] - p_.point[j]);
    return true;
  }

  bool Common(const std::uint32_t* others, double* centre) const {
    std::uint32_t ids[K + 1];
    ids[0] = p_.id;
    for (int s = 0; s < K; ++s) {
      if (IsFake(others[s])) return false;
      ids[s + 1] = others[s];
    }
    std::sort(ids, ids + K + 1);
    const double* points[K + 1];
    const double* tangents[K + 1];
    double weights[K + 1];
    for (int i = 0; i <= K; ++i) {
      const Site site = Find(ids[i]);
      points[i] = site.point;
      tangents[i] = site.tangent;
      weights[i] = complex_.Weight(site.id);
    }
    double radius2;
    if (!CommonCentre<K>(complex_.d_, points, tangents, weights, centre, &radius2)) return false;
    if (radius2 > complex_.judged_radius2_) return false;
    for (int i = 0; i < complex_.d_; ++i) centre[i] += points[0][i] - p_.point[i];
    return true;
  }

  const StarComplex& complex_;
  const Site& p_;
  const Site* guest_;
  const Site* newcomer_;
  const Cell* born_;
};

template <int K>
double StarComplex<K>::Project(const Site& p, const double* q, double* step, double* normal) const {
  for (int i = 0; i < d_; ++i) step[i] = q[i] - p.point[i];
  for (int a = 0; a < K; ++a) normal[a] = Dot(p.tangent + a * d_, step, d_);
  return Dot(step, step, d_);
}

template <int K>
double StarComplex<K>::Project(std::uint32_t p, const double* q, double* normal) const {
  Step step(d_);
  return Project(At(p), q, step.data(), normal);
}

template <int K>
void StarComplex<K>::Lift(std::uint32_t p, const double* x, double* point) const {
  const double* at = Point(p);
  const double* tangent = Tangent(p);
  for (int i = 0; i < d_; ++i) {
    double s = at[i];
    for (int a = 0; a < K; ++a) s += x[a] * tangent[a * d_ + i];
    point[i] = s;
  }
}

template <int K>
double StarComplex<K>::HalfSpace(const Site& p, const Site& q, double* step, double* normal) const {
  return 0.5 * (Project(p, q.point, step, normal) + Weight(p.id) - Weight(q.id));
}

template <int K>
double StarComplex<K>::HalfSpace(std::uint32_t p, std::size_t facet, double* normal) const {
  if constexpr (K == 2) {
    const Site site = At(p);
    return Around(*this, site, nullptr).HalfSpace(cells_[p].id(facet), normal);
  } else {
    std::copy_n(cells_[p].normal(facet), K, normal);
    return cells_[p].offset(facet);
  }
}

template <int K>
double StarComplex<K>::EdgeLength2(std::uint32_t p, std::size_t facet) const {
  if constexpr (K == 2)
    return SquaredDistance(Point(p), Point(cells_[p].id(facet)), d_);
  else
    return 2 * cells_[p].offset(facet);
}

template <int K>
bool StarComplex<K>::ClipBy(Cell& cell, const Site& p, const Site& q, const Site* guest,
                            const Cell* born, typename Cell::Scratch& scratch) const {
  Step step(d_);
  double normal[K];
  const double offset = HalfSpace(p, q, step.data(), normal);
  return cell.Clip(q.id, normal, offset, scratch, Around(*this, p, guest, &q, born), step.data());
}

template <int K>
bool StarComplex<K>::Cuts(const Cell& cell, const Site& p, const Site& q) const {
  Step step(d_);
  double normal[K];
  const double offset = HalfSpace(p, q, step.data(), normal);
  return cell.WouldCut(normal, offset, step.data());
}

template <int K>
int StarComplex<K>::Nearest(const double* q, int count,
                            std::pair<double, std::uint32_t>* nearest) const {
  int found = 0;
  tree_.VisitNear(
      q, [&] { return found < count ? INFINITY : std::sqrt(nearest[count - 1].first); },
      [&](std::uint32_t id, double distance2) {
        const std::pair<double, std::uint32_t> candidate{distance2, id};
        if (found == count && !(candidate < nearest[count - 1])) return;
        int at = found < count ? found++ : count - 1;
        for (; at > 0 && candidate < nearest[at - 1]; --at) nearest[at] = nearest[at - 1];
        nearest[at] = candidate;
      });
  return found;
}

template <int K>
bool StarComplex<K>::CutsVertex(std::uint32_t p, std::size_t vertex, const double* point) const {
  Step step(d_);
  double normal[K];
  const Site site = At(p);
  const double offset = 0.5 * Project(site, point, step.data(), normal);
  return cells_[p].WouldCutVertex(vertex, normal, offset, step.data());
}

// The sample points that most likely close a cell around q, the nearest first: those nearest, or,
// where a star near q is known, that star and the stars of its points nearest to q.
template <int K>
void StarComplex<K>::Neighbourhood(const double* q, std::uint32_t near,
                                   std::vector<std::uint32_t>* ids) const {
  ids->clear();
  constexpr int kCount = kNearestFirst<K>;
  std::array<std::pair<double, std::uint32_t>, kCount> nearest;
  if (near == kNone || !cells_[near].bounded()) {
    const int count = Nearest(q, kCount, nearest.data());
    for (int i = 0; i < count; ++i) ids->push_back(nearest[static_cast<std::size_t>(i)].second);
    return;
  }
  int count = 0;
  const auto offer = [&](std::uint32_t id) {
    const std::pair<double, std::uint32_t> candidate{SquaredDistance(q, Point(id), d_), id};
    if (count == K + 1 && !(candidate < nearest[K])) return;
    int at = count < K + 1 ? count++ : K;
    for (; at > 0 && candidate < nearest[at - 1]; --at) nearest[at] = nearest[at - 1];
    nearest[at] = candidate;
  };
  offer(near);
  for (std::size_t f = 0; f < cells_[near].facet_count(); ++f)
    if (!IsFake(cells_[near].id(f))) offer(cells_[near].id(f));
  const auto add = [&](std::uint32_t id) {
    if (!IsFake(id) && std::find(ids->begin(), ids->end(), id) == ids->end()) ids->push_back(id);
  };
  for (int i = 0; i < count; ++i) ids->push_back(nearest[i].second);
  for (int i = 0; i < count; ++i) {
    const Cell& cell = cells_[nearest[i].second];
    for (std::size_t f = 0; f < cell.facet_count(); ++f) add(cell.id(f));
  }
}

template <int K>
template <typename Influencing>
void StarComplex<K>::BuildStar(const Site& p, const Site* guest, std::uint32_t near, Cell& cell,
                               typename Cell::Scratch& scratch,
                               const Influencing& influencing) const {
  cell.Reset(inradius_, Around(*this, p, guest));
  // What closes the cell, or nearly so, comes first: without it a search that happens to begin on
  // one side of p would visit all of that side while the cell is open towards the other.
  thread_local std::vector<std::uint32_t> first;
  Neighbourhood(p.point, near, &first);
  for (const std::uint32_t q : first)
    if (q != p.id) ClipBy(cell, p, At(q), guest, nullptr, scratch);
  double reach = Influence(cell);
  tree_.VisitAround(
      p.point, [&] { return reach; },
      [&](std::uint32_t q, double) {
        // Once by each point: a second cut by the same plane would be decided by rounding.
        if (q == p.id || std::find(first.begin(), first.end(), q) != first.end()) return;
        if (ClipBy(cell, p, At(q), guest, nullptr, scratch)) reach = Influence(cell);
      },
      influencing);
}

template <int K>
bool StarComplex<K>::SimplexOf(std::uint32_t p, const Cell& cell, std::size_t v,
                               Simplex* simplex) const {
  (*simplex)[0] = p;
  for (int s = 0; s < K; ++s) {
    const std::uint32_t id = cell.id(cell.facet(v, s));
    if (IsFake(id)) return false;
    std::size_t at = static_cast<std::size_t>(s) + 1;
    for (; at > 0 && (*simplex)[at - 1] > id; --at) (*simplex)[at] = (*simplex)[at - 1];
    (*simplex)[at] = id;
  }
  return true;
}

template <int K>
void StarComplex<K>::Owned(std::uint32_t p, std::vector<Simplex>* simplices) const {
  simplices->clear();
  const Cell& cell = cells_[p];
  Simplex s;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    bool lowest = true;
    for (int i = 0; i < K; ++i) lowest = lowest && cell.id(cell.facet(v, i)) > p;
    if (lowest && SimplexOf(p, cell, v, &s)) simplices->push_back(s);
  }
  std::sort(simplices->begin(), simplices->end());
}

template <int K>
std::uint32_t StarComplex<K>::Append(const double* point, const double* tangent,
                                     std::uint32_t near) {
  const std::uint32_t id = size();
  near_.push_back(near);
  points_.insert(points_.end(), point, point + d_);
  tangents_.insert(tangents_.end(), tangent, tangent + d_ * K);
  tree_.Insert(0);  // until Commit it is found by place, but has no influence
  return id;
}

template <int K>
bool StarComplex<K>::AnyWithin(const double* q, double radius) const {
  return tree_.AnyWithin(q, radius);
}

template <int K>
typename StarComplex<K>::Change StarComplex<K>::Commit(std::vector<std::uint32_t>* around) {
  const auto first = static_cast<std::uint32_t>(cells_.size());
  const std::uint32_t count = size() - first;
  Change change;
  if (count == 0) return change;
  cells_.resize(size());

  // Which old stars does each new point cut? Their influence is still that of before.
  struct Cut {
    std::uint32_t star, by;
    bool operator<(const Cut& other) const {
      return star != other.star ? star < other.star : by < other.by;
    }
  };
  const std::size_t chunks = ChunkCount(count);
  std::vector<std::vector<Cut>> cuts_by_chunk(chunks);
  ParallelChunks(count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    Cell cell;  // its memory is used again and again; what is kept is no larger than it must be
    for (std::size_t i = begin; i < end && !IsInterrupted(); ++i) {
      const Site q = At(first + static_cast<std::uint32_t>(i));
      BuildStar(q, nullptr, near_[i], cell, ThreadScratch<K>(), [&](std::uint32_t p) {
        if (Cuts(cells_[p], At(p), q)) cuts_by_chunk[chunk].push_back({p, q.id});
      });
      cells_[q.id] = cell;
    }
  });
  near_.clear();

  std::vector<Cut> cuts;
  std::size_t cut_count = 0;
  for (const std::vector<Cut>& some : cuts_by_chunk) cut_count += some.size();
  cuts.reserve(cut_count);
  for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
    LookUp(chunk * ChunkSize(count));
    std::vector<Cut>& some = cuts_by_chunk[chunk];
    cuts.insert(cuts.end(), some.begin(), some.end());
    some = {};
  }
  ParallelSort(cuts, std::less<>());
  // New points that follow each other are mostly near each other: stars in the order in which these
  // come to them find in the cache what their neighbours have read.
  struct Turn {
    std::uint32_t first, star;  // `first` is the first that cuts the star
    std::size_t begin, end;     // its cuts
    bool operator<(const Turn& other) const {
      return first != other.first ? first < other.first : star < other.star;
    }
  };
  std::vector<Turn> turns;
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    LookUp(i);
    if (i == 0 || cuts[i].star != cuts[i - 1].star)
      turns.push_back({cuts[i].by, cuts[i].star, i, i});
    ++turns.back().end;
  }
  ParallelSort(turns, std::less<>());
  change.stars.reserve(turns.size());
  for (const Turn& turn : turns) change.stars.push_back(turn.star);

  const auto note_neighbours = [&](std::uint32_t p, std::size_t step) {
    LookUp(step);
    const Cell& cell = cells_[p];
    for (std::size_t f = 0; f < cell.facet_count(); ++f)
      if (!IsFake(cell.id(f))) around->push_back(cell.id(f));
  };
  if (around)
    for (std::size_t i = 0; i < change.stars.size(); ++i) note_neighbours(change.stars[i], i);

  struct Swap {
    std::vector<Simplex> removed, added;
  };
  std::vector<Swap> swaps(ChunkCount(turns.size()) + chunks);
  ParallelChunks(turns.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    std::vector<Simplex> before, after;
    Swap& swap = swaps[chunk];
    for (std::size_t i = begin; i < end && !IsInterrupted(); ++i) {
      const std::uint32_t p = turns[i].star;
      Owned(p, &before);
      for (std::size_t j = turns[i].begin; j < turns[i].end; ++j)
        ClipBy(cells_[p], At(p), At(cuts[j].by), nullptr, &cells_[cuts[j].by], ThreadScratch<K>());
      Owned(p, &after);
      std::set_difference(before.begin(), before.end(), after.begin(), after.end(),
                          std::back_inserter(swap.removed));
      std::set_difference(after.begin(), after.end(), before.begin(), before.end(),
                          std::back_inserter(swap.added));
    }
  });
  // A new point has the largest id of its simplices but for those among new points alone.
  ParallelChunks(count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    std::vector<Simplex> owned;
    std::vector<Simplex>& added = swaps[swaps.size() - chunks + chunk].added;
    for (std::size_t i = begin; i < end; ++i) {
      Owned(first + static_cast<std::uint32_t>(i), &owned);
      added.insert(added.end(), owned.begin(), owned.end());
    }
  });

  if (around) {
    for (std::size_t i = 0; i < change.stars.size(); ++i) note_neighbours(change.stars[i], i);
    for (std::uint32_t p = first; p < size(); ++p) note_neighbours(p, p);
  }
  const auto set_influence = [&](std::uint32_t p, std::size_t step) {
    LookUp(step);
    tree_.SetInfluence(p, Influence(cells_[p]));
  };
  for (std::size_t i = 0; i < change.stars.size(); ++i) set_influence(change.stars[i], i);
  for (std::uint32_t p = first; p < size(); ++p) set_influence(p, p);
  tree_.Refit();
  for (const Swap& swap : swaps) {
    ThrowIfInterrupted();
    for (const Simplex& s : swap.removed)
      change.removed.insert(change.removed.end(), s.begin(), s.end());
    for (const Simplex& s : swap.added) change.added.insert(change.added.end(), s.begin(), s.end());
  }
  simplex_count_ += change.added.size() / (K + 1);
  simplex_count_ -= change.removed.size() / (K + 1);
  return change;
}

template <int K>
void StarComplex<K>::TryPoint(const double* point, const double* tangent, std::uint32_t near,
                              typename Cell::Scratch& scratch, Tentative* result) const {
  const Site guest{size(), point, tangent};
  result->cut.clear();
  BuildStar(guest, &guest, near, result->own, scratch, [&](std::uint32_t p) {
    if (Cuts(cells_[p], At(p), guest)) result->cut.emplace_back(p, cells_[p]);
  });
  for (auto& [p, cell] : result->cut) ClipBy(cell, At(p), guest, &guest, &result->own, scratch);
  std::sort(result->cut.begin(), result->cut.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
}

template <int K>
std::vector<std::uint32_t> StarComplex<K>::Simplices() const {
  std::vector<std::uint32_t> all;
  all.reserve(simplex_count_ * (K + 1));
  std::vector<Simplex> owned;
  for (std::uint32_t p = 0; p < cells_.size(); ++p) {
    LookUp(p);
    Owned(p, &owned);
    for (const Simplex& s : owned) all.insert(all.end(), s.begin(), s.end());
  }
  return all;
}

template <int K>
Eigen::MatrixXd StarComplex<K>::TangentMatrix() const {
  Eigen::MatrixXd matrix(d_ * K, size());
  for (std::uint32_t p = 0; p < size(); ++p)
    for (int a = 0; a < K; ++a)
      for (int i = 0; i < d_; ++i) matrix(i * K + a, p) = Tangent(p)[a * d_ + i];
  return matrix;
}

template class StarComplex<1>;
template class StarComplex<2>;
template class StarComplex<3>;
template class StarComplex<4>;
template class StarComplex<5>;

}  // namespace stellate::core
