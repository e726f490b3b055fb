#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/complex/centre_cache.h"
#include "core/complex/star_builder.h"
#include "core/geometry/common_centre.h"

namespace stellate::core {

// Gives the cell of p the half-spaces of its facets, and the centres at which its simplices are
// judged. Borrows all its arguments.
template <int K>
class StarSurroundings final : public Surroundings<K> {
 public:
  using Cell = RestrictedVoronoiCell<K>;
  using Simplex = typename CentreCache<K>::Simplex;

  // centre_rule  replaces the builder's
  // newcomer     the site that cuts p's cell now, which may not be in the sample
  // born         the newcomer's star if there is one, in which centres are looked up first
  StarSurroundings(const StarBuilder<K>& builder, const Site& p, CentreRule centre_rule,
                   const Site* newcomer = nullptr, const Cell* born = nullptr)
      : sample_(builder.sample()),
        builder_(builder),
        p_(p),
        centre_rule_(centre_rule),
        newcomer_(newcomer),
        born_(born) {}

  double HalfSpace(std::uint32_t id, double* normal) const override {
    if (IsFake(id))
      return FakeHalfSpace<K>(static_cast<int>(id - kFirstFakeId), builder_.options().inradius,
                              normal);
    if (IsWall(id)) {
      const double sign = IsSubset(SetOfWall(WallOf(id)), p_.reversed) ? -1 : 1;
      for (int a = 0; a < K; ++a) normal[a] = sign * ConormalOf(p_, WallOf(id))[a];
      return kWallOffset * builder_.options().inradius;
    }
    Step step(sample_.d());
    return builder_.HalfSpace(p_, Find(id), step.data(), normal);
  }

  int judged_in() const override {
    return centre_rule_ == CentreRule::kTangentSpace ? 0 : sample_.d();
  }

  bool Centre(const std::uint32_t* ids, std::uint64_t key, double* x,
              double* centre) const override {
    // The facets of a k-simplex in R^k meet at its circumcentre.
    if (sample_.d() == K && std::none_of(ids, ids + K, IsWall)) return false;
    if (!(born_ && Known(key, centre)) && !Common(ids, key, centre)) return false;
    WithDimension(sample_.d(), [&](auto known) {
      const int n = known() > 0 ? known() : sample_.d();
      for (int a = 0; a < K; ++a) x[a] = Dot(p_.tangent + a * n, centre, n);
    });
    return true;
  }

  void Lift(const double* x, double* centre) const override {
    const int n = sample_.d();
    std::fill(centre, centre + n, 0.0);
    for (int a = 0; a < K; ++a)
      for (int i = 0; i < n; ++i) centre[i] += x[a] * p_.tangent[a * n + i];
  }

 private:
  Site Find(std::uint32_t id) const {
    return id == p_.id ? p_ : IsNewcomer(id) ? *newcomer_ : sample_.At(id);
  }

  bool IsNewcomer(std::uint32_t id) const { return newcomer_ && id == newcomer_->id; }
  const double* PointOf(std::uint32_t id) const {
    return id == p_.id ? p_.point : IsNewcomer(id) ? newcomer_->point : sample_.Point(id);
  }
  const double* TangentOf(std::uint32_t id) const {
    return id == p_.id ? p_.tangent : IsNewcomer(id) ? newcomer_->tangent : sample_.Tangent(id);
  }

  // Looks the centre up in the newcomer's star: all simplices that it creates are in it if they are
  // consistent.
  bool Known(std::uint64_t key_in_p, double* centre) const {
    const std::uint64_t key = key_in_p + Mix64(p_.id) - Mix64(newcomer_->id);
    const std::size_t v = born_->Find(key);
    if (v == born_->vertex_count() || !born_->judged(v)) return false;
    const double* const there = born_->Centre(v);
    for (int j = 0; j < sample_.d(); ++j)
      centre[j] = there[j] + (newcomer_->point[j] - p_.point[j]);
    return true;
  }

  // `key`: the sum of Mix64 over the ids of the others.
  bool Common(const std::uint32_t* others, std::uint64_t key, double* centre) const {
    Simplex ids;
    ids[0] = p_.id;
    int count = 1;
    WallSet walls = 0;
    for (int s = 0; s < K; ++s) {
      if (IsFake(others[s])) return false;
      if (IsWall(others[s]))
        walls |= SetOfWall(WallOf(others[s]));
      else
        ids[static_cast<std::size_t>(count++)] = others[s];
    }
    std::uint32_t* const first = ids.data();
    for (int i = 1; i < count; ++i)  // they are few
      for (int j = i; j > 0 && first[j] < first[j - 1]; --j) std::swap(first[j], first[j - 1]);
    if (walls != 0) return CommonOnFace(ids.data(), count, walls, centre);
    const int n = sample_.d();
    // The id of a point that may join the sample may be another's next.
    const bool lasts = ids[K] < sample_.size();
    thread_local CentreCache<K> cache;
    const auto find = [&](double* found) { return FindCommon(ids, found); };
    if (!(lasts ? cache.Centre(sample_.centre_owner(), ids, key + Mix64(p_.id), n, centre, find)
                : find(centre)))
      return false;
    const double* const origin = PointOf(ids[0]);
    for (int i = 0; i < n; ++i) centre[i] += origin[i] - p_.point[i];
    return true;
  }

  // Relative to the first point.
  bool FindCommon(const Simplex& ids, double* centre) const {
    const double* points[K + 1];
    const double* tangents[K + 1];
    double weights[K + 1];
    for (std::size_t i = 0; i <= K; ++i) {
      points[i] = PointOf(ids[i]);
      tangents[i] = TangentOf(ids[i]);
      weights[i] = sample_.Weight(ids[i]);
    }
    return CommonCentre<K>(sample_.d(), points, tangents, weights, builder_.judged_radius2(),
                           centre);
  }

  // The same for a simplex of a face, by the face's own tangent spaces. Foreign simplices stay in
  // the tangent space: no other star agrees about them. So do simplices that reach from one sheet
  // of a wall to another: a centre in the middle between the two has no meaning for either.
  bool CommonOnFace(const std::uint32_t* ids, int count, WallSet walls, double* centre) const {
    if (count < 2) return false;
    const int n = sample_.d();
    const double* points[K + 1];
    const double* tangents[K + 1];
    double weights[K + 1];
    thread_local std::vector<double> bases;
    const auto stride = static_cast<std::size_t>(count - 1) * static_cast<std::size_t>(n);
    bases.resize(stride * (K + 1));
    for (int i = 0; i < count; ++i) {
      const Site site = Find(ids[i]);
      if (!IsSubset(walls, site.walls)) return false;
      if (i > 0 && !FaceAlike(Find(ids[0]), site, walls, n)) return false;
      FaceTangents(site, walls, n, bases.data() + static_cast<std::size_t>(i) * stride);
      points[i] = site.point;
      tangents[i] = bases.data() + static_cast<std::size_t>(i) * stride;
      weights[i] = sample_.Weight(site.id);
    }
    const auto common = [&](auto dimension) {
      return CommonCentre<decltype(dimension)::value>(n, points, tangents, weights,
                                                      builder_.judged_radius2(), centre);
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

  // Whether the conormals at two points of a face are less than a right angle apart, wall by wall,
  // and all together: the spaces that they span, oriented by them. Where two walls nearly touch,
  // both conormals are nearly the same on all branches of their edge, whose directions are not.
  static bool FaceAlike(const Site& one, const Site& other, WallSet walls, int n) {
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, K, K> cosines(CountWalls(walls),
                                                                           CountWalls(walls));
    Eigen::Index row = 0;
    ForEachWall(walls, [&](int here) {
      Eigen::Index column = 0;
      ForEachWall(walls,
                  [&](int there) { cosines(row, column++) = Cosine(one, here, other, there, n); });
      ++row;
    });
    return (cosines.diagonal().array() > 0).all() && cosines.determinant() > 0;
  }

  // Of the angle between the conormals of two walls, each at a point.
  static double Cosine(const Site& one, int here, const Site& other, int there, int n) {
    const double* const a = ConormalOf(one, here);
    const double* const b = ConormalOf(other, there);
    double cosine = 0;
    for (int i = 0; i < K; ++i)
      for (int j = 0; j < K; ++j)
        cosine += a[i] * b[j] * Dot(one.tangent + i * n, other.tangent + j * n, n);
    return cosine;
  }

  static const double* ConormalOf(const Site& site, int wall) {
    return site.conormals + K * CountWalls(site.walls & (SetOfWall(wall) - 1));
  }

  // Writes an orthonormal basis of the tangent space of a face at a point of it, the part of T_pM
  // orthogonal to the conormals, in rows of d.
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
      double best[K] = {}, most = -1;
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

  const Sample<K>& sample_;
  const StarBuilder<K>& builder_;
  const Site& p_;
  const CentreRule centre_rule_;
  const Site* newcomer_;
  const Cell* born_;
};

}  // namespace stellate::core
