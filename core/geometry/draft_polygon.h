#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include "core/base/vector_ops.h"
#include "core/geometry/half_spaces.h"
#include "core/geometry/restricted_voronoi_polygon.h"

namespace stellate::core {

// A RestrictedVoronoiCell<2> while it is being clipped. It keeps its half-spaces, which the
// finished cell does not store, so that each is computed once. The polygon is the same as by that
// class's own cuts, bit for bit and vertex by vertex.
//
//   DraftPolygon polygon;  // one for each thread: it reuses its memory
//   polygon.Reset(inradius);
//   for (q ...) polygon.Clip(q, normal, offset);
//   cell.Take(polygon);
class DraftPolygon {
 public:
  // Begins with a regular triangle of fake facets at distance `inradius` from p.
  void Reset(double inradius) {
    if (inradius != inradius_) Begin(inradius);
    if (capacity_ == 0) Grow();
    for (std::size_t v = 0; v < 3; ++v) {
      sides_[v] = fake_[v].side;
      Put(v, fake_[v].x, fake_[v].norm2);
    }
    count_ = 3;
    max_norm2_ = 4 * inradius * inradius;
  }

  // Begins with a finished cell, whose vertices are not judged. A cell has no half-spaces: Clip
  // computes those it needs.
  void Resume(const RestrictedVoronoiCell<2>& cell) {
    count_ = cell.vertex_count();
    while (count_ > capacity_) Grow();
    for (std::size_t v = 0; v < count_; ++v) {
      const double* const x = cell.x(v);
      Put(v, x, x[0] * x[0] + x[1] * x[1]);
      sides_[v].offset = kUnknown;
      sides_[v].id = cell.id(v);
    }
    max_norm2_ = cell.max_norm2();
  }

  // Vertex v is on the facets v and v + 1, cyclically.
  std::size_t count() const { return count_; }
  double x(std::size_t v) const { return x_[v]; }
  double y(std::size_t v) const { return y_[v]; }
  std::uint32_t id(std::size_t facet) const { return sides_[facet].id; }
  double max_norm2() const { return max_norm2_; }

  // For a polygon that was not resumed: all half-spaces are known.
  struct KnowsAll {};

  // Writes the normal of q's half-space in the tangent space at p, for points with these weights,
  // and returns its offset.
  double HalfSpace(int any_d, const double* p, const double* tangent, double p_weight,
                   const double* q, double q_weight, double* normal) {
    return WithDimension(any_d, [&](auto known) {
      return HalfSpaceIn(known, any_d, p, tangent, p_weight, q, q_weight, normal);
    });
  }

  // Clips by that half-space; `find` as below.
  template <typename Find = KnowsAll>
  bool ClipBy(std::uint32_t id, int any_d, const double* p, const double* tangent, double p_weight,
              const double* q, double q_weight, const Find& find = {}) {
    return WithDimension(any_d, [&](auto known) {
      double normal[2];
      const double offset = HalfSpaceIn(known, any_d, p, tangent, p_weight, q, q_weight, normal);
      return Clip(id, normal, offset, find);
    });
  }

  // Clips as RestrictedVoronoiCell<2>::Clip does. find(id, normal) writes the normal of a facet
  // that the resumed cell had, and returns its offset.
  template <typename Find = KnowsAll>
  bool Clip(std::uint32_t id, const double* normal, double offset, const Find& find = {}) {
    const std::size_t count = count_;
    const double a = normal[0], b = normal[1];
    const double *const x = x_.data(), *const y = y_.data();
    double* const excess = excess_.data();
    for (std::size_t v = 0; v < count; v += 2) {  // the capacity is even
      excess[v] = a * x[v] + b * y[v] - offset;
      excess[v + 1] = a * x[v + 1] + b * y[v + 1] - offset;
    }
    std::size_t worst = 0;
    while (!(excess[worst] > 0))
      if (++worst == count) return false;
    for (std::size_t v = worst + 1; v < count; ++v)
      if (excess[v] > excess[worst]) worst = v;
    std::size_t first = worst, last = worst, cut = 1;
    for (; excess[Previous(first)] > 0; first = Previous(first))
      if (++cut == count) return false;
    for (; excess[Next(last)] > 0; last = Next(last))
      if (++cut == count) return false;
    const std::size_t before = Previous(first), after = Next(last);
    const Side side = Known(first, find), added{{a, b}, offset, id};
    double created[2][2];
    const double norm2s[2] = {Locate(side, before, first, added, created[0]),
                              Locate(Known(after, find), after, last, added, created[1])};
    const std::size_t place = Close(first, last, cut);
    sides_[place] = side;
    sides_[place + 1] = added;
    for (std::size_t e = 0; e < 2; ++e) Put(place + e, created[e], norm2s[e]);
    max_norm2_ = 0;
    for (std::size_t v = 0; v < count_; ++v) max_norm2_ = std::max(max_norm2_, norm2_[v]);
    return true;
  }

 private:
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  struct Side {
    double normal[2], offset;
    std::uint32_t id;
  };
  struct FakeCorner {
    double x[2], norm2;
    Side side;
  };

  void Begin(double inradius) {
    inradius_ = inradius;
    for (std::size_t i = 0; i < 3; ++i) {
      auto& [x, norm2, side] = fake_[i];
      side.id = kFirstFakeId + static_cast<std::uint32_t>(i);
      side.offset = FakeHalfSpace<2>(static_cast<int>(i), inradius, side.normal);
      FakeHalfSpace<2>(static_cast<int>((i + 2) % 3), inradius, x);  // of the opposite side
      x[0] *= -2;
      x[1] *= -2;
      norm2 = x[0] * x[0] + x[1] * x[1];
    }
  }

  void Grow() {
    capacity_ += 16;
    for (std::vector<double>* const numbers : {&x_, &y_, &norm2_, &excess_})
      numbers->resize(capacity_);
    sides_.resize(capacity_);
  }

  std::size_t Next(std::size_t v) const { return v + 1 < count_ ? v + 1 : 0; }
  std::size_t Previous(std::size_t v) const { return v > 0 ? v - 1 : count_ - 1; }

  template <typename Find>
  const Side& Known(std::size_t facet, [[maybe_unused]] const Find& find) {
    Side& side = sides_[facet];
    if constexpr (!std::is_same_v<Find, KnowsAll>)
      if (std::isnan(side.offset)) side.offset = find(side.id, side.normal);
    return side;
  }

  template <typename Known>
  double HalfSpaceIn(Known known, int any_d, const double* p, const double* tangent,
                     double p_weight, const double* q, double q_weight, double* normal) {
    const int d = known() > 0 ? known() : any_d;
    double few[known() > 0 ? known() : 1];
    if (known() == 0) step_.resize(static_cast<std::size_t>(d));
    double* const step = known() > 0 ? few : step_.data();
    for (int i = 0; i < d; ++i) step[i] = q[i] - p[i];
    normal[0] = Dot(tangent, step, d);
    normal[1] = Dot(tangent + d, step, d);
    return 0.5 * (Dot(step, step, d) + p_weight - q_weight);
  }

  void Put(std::size_t v, const double* x, double norm2) {
    x_[v] = x[0];
    y_[v] = x[1];
    norm2_[v] = norm2;
  }

  // Finds where a facet meets the cut, between a vertex that is kept and one that is removed.
  double Locate(const Side& side, std::size_t kept, std::size_t removed, const Side& cut,
                double* created) const {
    const double at_kept[2] = {x_[kept], y_[kept]}, at_removed[2] = {x_[removed], y_[removed]};
    HalfSpaceRef<2> planes[2] = {{side.id, side.normal, side.offset},
                                 {cut.id, cut.normal, cut.offset}};
    return Meet<2>(planes, {at_kept, norm2_[kept], excess_[kept]},
                   {at_removed, norm2_[removed], excess_[removed]}, kSlack, created);
  }

  void Move(std::size_t from, std::size_t to) {
    x_[to] = x_[from];
    y_[to] = y_[from];
    norm2_[to] = norm2_[from];
    sides_[to] = sides_[from];
  }

  // Makes a gap for the two created vertices, and returns its place: that of the removed chain, or
  // the end if the chain goes over the end.
  std::size_t Close(std::size_t first, std::size_t last, std::size_t cut) {
    const std::size_t count = count_;
    count_ = count - cut + 2;
    if (count_ > capacity_) Grow();
    if (first > last) {
      for (std::size_t v = last + 1; v < first; ++v) Move(v, v - last - 1);
      return count_ - 2;
    }
    if (cut < 2)
      for (std::size_t v = count; v-- > last + 1;) Move(v, v + 1);
    if (cut > 2)
      for (std::size_t v = last + 1; v < count; ++v) Move(v, v + 2 - cut);
    return first;
  }

  double inradius_ = 0;
  FakeCorner fake_[3];  // the triangle that it begins with
  std::size_t count_ = 0, capacity_ = 0;
  double max_norm2_ = 0;
  std::vector<double> x_, y_, norm2_, excess_;  // by vertex
  std::vector<Side> sides_;                     // by vertex: the facet before it
  std::vector<double> step_;
};

}  // namespace stellate::core
