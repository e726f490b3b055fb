#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/vector_ops.h"
#include "core/geometry/half_spaces.h"
#include "core/geometry/surroundings.h"

namespace stellate::core {

// A RestrictedVoronoiCell<2> in the making: it keeps its half-spaces, which the finished cell has
// no room for, so that each is found once. The same polygon as by that class' own cuts, bit for bit
// and vertex by vertex.
class LaidPolygon {
 public:
  // A vertex, and the facet that goes on from it: vertex v is on the facets v and v + 1,
  // cyclically.
  struct Corner {
    double x[2];
    double norm2;
    double normal[2], offset;
    std::uint32_t id;
  };

  // A regular triangle of fake facets at distance `inradius` from p.
  void Reset(double inradius) {
    if (inradius != inradius_) Begin(inradius);
    corners_ = fake_;
    max_norm2_ = 4 * inradius * inradius;
  }

  const std::vector<Corner>& corners() const { return corners_; }
  double max_norm2() const { return max_norm2_; }

  // By the half-space of q in the tangent space at p, where they have these weights.
  bool ClipBy(std::uint32_t id, int any_d, const double* p, const double* tangent, double p_weight,
              const double* q, double q_weight) {
    thread_local std::vector<double> step;
    step.resize(static_cast<std::size_t>(any_d));
    double* const away = step.data();
    return WithDimension(any_d, [&](auto known) {
      const int d = known() > 0 ? known() : any_d;
      for (int i = 0; i < d; ++i) away[i] = q[i] - p[i];
      const double normal[2] = {Dot(tangent, away, d), Dot(tangent + d, away, d)};
      return Clip(id, normal, 0.5 * (Dot(away, away, d) + p_weight - q_weight));
    });
  }

  // As RestrictedVoronoiCell<2>::Clip.
  bool Clip(std::uint32_t id, const double* normal, double offset) {
    const std::size_t count = corners_.size();
    if (excess_.size() < count) excess_.resize(2 * count);
    std::size_t worst = 0;
    for (std::size_t v = 0; v < count; ++v) {
      excess_[v] = normal[0] * corners_[v].x[0] + normal[1] * corners_[v].x[1] - offset;
      if (excess_[v] > excess_[worst]) worst = v;
    }
    if (!(excess_[worst] > 0)) return false;
    std::size_t first = worst, last = worst, cut = 1;
    for (; excess_[Previous(first)] > 0; first = Previous(first))
      if (++cut == count) return false;
    for (; excess_[Next(last)] > 0; last = Next(last))
      if (++cut == count) return false;
    const std::size_t after = Next(last);
    Corner before_gap = corners_[first], behind_gap{};
    Locate(first, Previous(first), first, {id, normal, offset}, &before_gap);
    Locate(after, after, last, {id, normal, offset}, &behind_gap);
    behind_gap.normal[0] = normal[0];
    behind_gap.normal[1] = normal[1];
    behind_gap.offset = offset;
    behind_gap.id = id;
    Close(first, last, cut, before_gap, behind_gap);
    max_norm2_ = 0;
    for (const Corner& corner : corners_) max_norm2_ = std::max(max_norm2_, corner.norm2);
    return true;
  }

 private:
  void Begin(double inradius) {
    inradius_ = inradius;
    fake_.resize(3);
    for (std::size_t i = 0; i < 3; ++i) {
      Corner& corner = fake_[i];
      corner.id = kFirstFakeId + static_cast<std::uint32_t>(i);
      corner.offset = FakeHalfSpace<2>(static_cast<int>(i), inradius, corner.normal);
      FakeHalfSpace<2>(static_cast<int>((i + 2) % 3), inradius, corner.x);  // of the opposite side
      corner.x[0] *= -2;
      corner.x[1] *= -2;
      corner.norm2 = corner.x[0] * corner.x[0] + corner.x[1] * corner.x[1];
    }
  }

  std::size_t Next(std::size_t v) const { return v + 1 < corners_.size() ? v + 1 : 0; }
  std::size_t Previous(std::size_t v) const { return v > 0 ? v - 1 : corners_.size() - 1; }

  // Where the facet of a corner meets the cut, between a corner that is kept and one that is not.
  void Locate(std::size_t facet, std::size_t kept, std::size_t removed, const HalfSpaceRef<2>& cut,
              Corner* created) const {
    const Corner& side = corners_[facet];
    HalfSpaceRef<2> planes[2] = {{side.id, side.normal, side.offset}, cut};
    created->norm2 = Meet<2>(planes, {corners_[kept].x, corners_[kept].norm2, excess_[kept]},
                             {corners_[removed].x, corners_[removed].norm2, excess_[removed]},
                             kSlack, created->x);
  }

  // The created take the place of the chain, or, where it goes over the end, come last.
  void Close(std::size_t first, std::size_t last, std::size_t cut, const Corner& before_gap,
             const Corner& behind_gap) {
    const std::size_t count = corners_.size(), size = count - cut + 2;
    const bool over_end = first > last;
    const std::size_t place = over_end ? size - 2 : first;
    if (size > count) corners_.resize(size);
    const auto at = [&](std::size_t v) {
      return corners_.begin() + static_cast<std::ptrdiff_t>(v);
    };
    if (over_end)
      std::copy(at(last + 1), at(first), at(0));
    else if (cut > 2)
      std::copy(at(last + 1), at(count), at(first + 2));
    else if (cut < 2)
      std::copy_backward(at(last + 1), at(count), at(size));
    corners_.resize(size);
    corners_[place] = before_gap;
    corners_[place + 1] = behind_gap;
  }

  double inradius_ = 0;
  std::vector<Corner> fake_;  // what it begins as
  std::vector<Corner> corners_;
  std::vector<double> excess_;
  double max_norm2_ = 0;
};

}  // namespace stellate::core
