#include "core/complex/star_complex.h"

#include <algorithm>
#include <type_traits>
#include <utility>

#include "core/base/basis_layout.h"
#include "core/base/parallel.h"
#include "core/geometry/common_centre.h"

namespace stellate::core {

namespace {

// How far outwards walls are moved, as a share of the fake simplex' inradius: corners of that may
// lie in the planes of walls along the axes, and rounding would decide which side of it they are
// on.
constexpr double kWallOffset = 1e-12;

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
      names_(other.names_),
      walls_(other.walls_),
      conormals_at_(other.conormals_at_),
      conormals_(other.conormals_),
      guards_(other.guards_),
      largest_guard_(other.largest_guard_),
      cells_(other.cells_),
      tree_(other.tree_, &points_),
      simplex_count_(other.simplex_count_) {}

// What the cell of p may ask.
template <int K>
class StarComplex<K>::Around final : public Surroundings<K> {
 public:
  Around(const StarComplex& complex, const Site& p, const Site* guest,
         const Site* newcomer = nullptr, const Cell* born = nullptr)
      : complex_(complex),
        p_(p),
        judging_(complex.judging_),
        guest_(guest),
        newcomer_(newcomer),
        born_(born) {}
  Around(const StarComplex& complex, const Site& p, Judging judging)
      : complex_(complex), p_(p), judging_(judging) {}

  double HalfSpace(std::uint32_t id, double* normal) const override {
    if (IsFake(id))
      return FakeHalfSpace<K>(static_cast<int>(id - kFirstFakeId), complex_.inradius_, normal);
    if (IsWall(id)) {
      std::copy_n(ConormalOf(p_, WallOf(id)), K, normal);
      return kWallOffset * complex_.inradius_;
    }
    Step step(complex_.d_);
    return complex_.HalfSpace(p_, Find(id), step.data(), normal);
  }

  int judged_in() const override { return judging_ == Judging::kFlats ? 0 : complex_.d_; }

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
    int count = 1;
    WallSet walls = 0;
    for (int s = 0; s < K; ++s) {
      if (IsFake(others[s])) return false;
      if (IsWall(others[s]))
        walls |= SetOfWall(WallOf(others[s]));
      else
        ids[count++] = others[s];
    }
    std::sort(ids, ids + count);
    if (walls != 0) return CommonOnFace(ids, count, walls, centre);
    const double* points[K + 1];
    const double* tangents[K + 1];
    double weights[K + 1];
    for (int i = 0; i <= K; ++i) {
      const Site site = Find(ids[i]);
      points[i] = site.point;
      tangents[i] = site.tangent;
      weights[i] = complex_.Weight(site.id);
    }
    if (!CommonCentre<K>(complex_.d_, points, tangents, weights, complex_.judged_radius2_, centre))
      return false;
    for (int i = 0; i < complex_.d_; ++i) centre[i] += points[0][i] - p_.point[i];
    return true;
  }

  // The same for a simplex of a face, by the face's own tangent spaces. Foreign ones are left where
  // they are: no other star agrees about them.
  bool CommonOnFace(const std::uint32_t* ids, int count, WallSet walls, double* centre) const {
    if (count < 2) return false;
    const int n = complex_.d_;
    const double* points[K + 1];
    const double* tangents[K + 1];
    double weights[K + 1];
    thread_local std::vector<double> bases;
    const auto stride = static_cast<std::size_t>(count - 1) * static_cast<std::size_t>(n);
    bases.resize(stride * (K + 1));
    for (int i = 0; i < count; ++i) {
      const Site site = Find(ids[i]);
      if (!IsSubset(walls, site.walls)) return false;
      FaceTangents(site, walls, n, bases.data() + static_cast<std::size_t>(i) * stride);
      points[i] = site.point;
      tangents[i] = bases.data() + static_cast<std::size_t>(i) * stride;
      weights[i] = complex_.Weight(site.id);
    }
    const auto common = [&](auto dimension) {
      return CommonCentre<decltype(dimension)::value>(n, points, tangents, weights,
                                                      complex_.judged_radius2_, centre);
    };
    bool found = false;
    [&]<int... J>(std::integer_sequence<int, J...>) {
      ((count == J + 2 && (found = common(std::integral_constant<int, J + 1>()))), ...);
    }
    (std::make_integer_sequence<int, K - 1>());
    if (!found) return false;
    for (int i = 0; i < n; ++i) centre[i] += points[0][i] - p_.point[i];
    return true;
  }

  static const double* ConormalOf(const Site& site, int wall) {
    return site.conormals + K * CountWalls(site.walls & (SetOfWall(wall) - 1));
  }

  // An orthonormal basis of the tangent space of a face at a point of it: what is left of T_pM off
  // the conormals, by rows of d.
  static void FaceTangents(const Site& site, WallSet walls, int n, double* rows) {
    double taken[K][K] = {};  // orthonormal, conormals first
    int count = 0;
    const auto orthogonalise = [&](double* v) {
      for (int pass = 0; pass < 2; ++pass)  // the second for what rounding left
        for (int i = 0; i < count; ++i) {
          const double along = Dot(taken[i], v, K);
          for (int a = 0; a < K; ++a) v[a] -= along * taken[i][a];
        }
      return Dot(v, v, K);
    };
    const auto take = [&](const double* v, double norm2) {
      for (int a = 0; a < K; ++a) taken[count][a] = v[a] / std::sqrt(norm2);
      ++count;
    };
    ForEachWall(walls, [&](int wall) {
      double v[K];
      std::copy_n(ConormalOf(site, wall), K, v);
      take(v, orthogonalise(v));
    });
    const int conormals = count;
    for (int left = K - conormals; left > 0; --left) {
      double best[K], most = -1;
      for (int a = 0; a < K; ++a) {
        double v[K] = {};
        v[a] = 1;
        if (const double norm2 = orthogonalise(v); norm2 > most) {
          most = norm2;
          std::copy_n(v, K, best);
        }
      }
      take(best, most);
    }
    for (int j = conormals; j < K; ++j)
      for (int i = 0; i < n; ++i) {
        double s = 0;
        for (int a = 0; a < K; ++a) s += taken[j][a] * site.tangent[a * n + i];
        rows[(j - conormals) * n + i] = s;
      }
  }

  const StarComplex& complex_;
  const Site& p_;
  const Judging judging_;
  const Site* guest_ = nullptr;
  const Site* newcomer_ = nullptr;
  const Cell* born_ = nullptr;
};

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
    return 2 * cells_[p].offset(facet) - GuardOf(p) + GuardOf(cells_[p].id(facet));
}

template <int K>
bool StarComplex<K>::ClipBy(Cell& cell, const Site& p, const Site& q, const Site* guest,
                            const Cell* born, typename Cell::Scratch& scratch) const {
  Step step(d_);
  double normal[K];
  const double offset = HalfSpace(p, q, step.data(), normal);
  const Around around(*this, p, guest, &q, born);
  return cell.Clip(q.id, normal, offset, scratch, around, step.data());
}

template <int K>
bool StarComplex<K>::Cuts(const Cell& cell, const Site& p, const Site& q) const {
  Step step(d_);
  double normal[K];
  const double offset = HalfSpace(p, q, step.data(), normal);
  return cell.WouldCut(normal, offset, step.data());
}

template <int K>
void StarComplex<K>::ResetInFlats(Cell& cell, const Site& p) const {
  cell.Reset(inradius_, Around(*this, p, Judging::kFlats));
}

template <int K>
bool StarComplex<K>::ClipInFlats(Cell& cell, const Site& p, const Site& q,
                                 typename Cell::Scratch& scratch) const {
  Step step(d_);
  double normal[K];
  const double offset = HalfSpace(p, q, step.data(), normal);
  return cell.Clip(q.id, normal, offset, scratch, Around(*this, p, Judging::kFlats));
}

template <int K>
bool StarComplex<K>::JudgeCell(Cell& cell, const Site& p,
                               const std::vector<std::pair<double, std::uint32_t>>& near) const {
  if constexpr (K == 2) {
    return false;
  } else {
    cell.Judge(Around(*this, p, judging_));
    const double reach = Influence(p.id, cell);
    Step step(d_);
    double normal[K];
    for (const auto& [distance2, q] : near) {
      if (distance2 > reach * reach) break;
      const double offset = HalfSpace(p, At(q), step.data(), normal);
      if (cell.WouldCutOthers(q, normal, offset, step.data())) return false;
    }
    return true;
  }
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
  const double offset = 0.5 * (Project(site, point, step.data(), normal) + GuardOf(p));
  return cells_[p].WouldCutVertex(vertex, normal, offset, step.data());
}

template <int K>
void StarComplex<K>::ResetCell(Cell& cell, const Site& p, const Site* guest,
                               typename Cell::Scratch& scratch) const {
  const Around around(*this, p, guest);
  cell.Reset(inradius_, around);
  if (p.walls == 0) return;
  Step step(d_);
  const double* conormal = p.conormals;
  ForEachWall(p.walls, [&](int wall) {
    around.Lift(conormal, step.data());
    cell.Clip(IdOfWall(wall), conormal, kWallOffset * inradius_, scratch, around, step.data());
    conormal += K;
  });
}

template <int K>
bool StarComplex<K>::AnyWithin(const double* q, double radius) const {
  return tree_.AnyWithin(q, radius);
}

template <int K>
std::vector<std::uint32_t> StarComplex<K>::Simplices() const {
  std::vector<std::uint32_t> all;
  all.reserve(simplex_count_ * (K + 1));
  std::vector<Simplex> owned;
  for (std::uint32_t p = 0; p < cells_.size(); ++p) {
    CheckInterruption(p);
    owned.clear();
    ForEachOwned(p, [&](std::size_t, const Simplex& s) { owned.push_back(s); });
    std::sort(owned.begin(), owned.end());
    for (const Simplex& s : owned) all.insert(all.end(), s.begin(), s.end());
  }
  return all;
}

template <int K>
Eigen::MatrixXd StarComplex<K>::TangentMatrix() const {
  Eigen::MatrixXd matrix(d_ * K, size());
  for (std::uint32_t p = 0; p < size(); ++p)
    ToByCoordinate(Tangent(p), d_, K, matrix.col(p).data());
  return matrix;
}

STELLATE_INSTANTIATE_CLASS(StarComplex)

}  // namespace stellate::core
