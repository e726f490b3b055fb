#include "core/geometry/restricted_voronoi_polygon.h"

#include <cmath>

#include "core/geometry/half_spaces.h"

namespace stellate::core {

using Polygon = RestrictedVoronoiCell<2>;

Polygon& Polygon::operator=(const Polygon& other) {
  if (this == &other) return *this;
  Resize(other.count_);
  std::copy_n(other.corners(), 2 * other.count_, corners());
  std::copy_n(other.ids(), other.count_, ids());
  if (!other.centres_)
    centres_.reset();
  else if (centres_)
    *centres_ = *other.centres_;
  else
    centres_ = std::make_unique<Centres>(*other.centres_);
  max_norm2_ = other.max_norm2_;
  has_fake_ = other.has_fake_;
  return *this;
}

double Polygon::norm2(std::size_t v) const {
  if (judged(v)) return Dot(Centre(v), Centre(v), static_cast<int>(centres_->d));
  return x(v)[0] * x(v)[0] + x(v)[1] * x(v)[1];
}

void Polygon::Reset(double inradius, const Surroundings<2>& around) {
  Resize(3);
  max_norm2_ = 4 * inradius * inradius;
  has_fake_ = true;
  for (std::size_t i = 0; i < 3; ++i) {
    ids()[i] = kFirstFakeId + static_cast<std::uint32_t>(i);
    double* const corner = corners() + 2 * i;
    FakeHalfSpace<2>(static_cast<int>((i + 2) % 3), inradius, corner);  // of the opposite side
    corner[0] *= -2;
    corner[1] *= -2;
  }
  const auto d = static_cast<std::size_t>(around.judged_in());
  if (d == 0) {
    centres_.reset();
    return;
  }
  if (!centres_) centres_ = std::make_unique<Centres>();
  centres_->d = d;
  centres_->at.resize(3 * d);
  centres_->judged.assign(3, 0);
  for (std::size_t v = 0; v < 3; ++v) around.Lift(x(v), centres_->at.data() + v * d);
}

// What is cut off a polygon is a chain of vertices, from `first` to `last`, and two new ones close
// the gap.
bool Polygon::Clip(std::uint32_t id, const double* normal, double offset, Scratch& scratch,
                   const Surroundings<2>& around, const double* step) {
  const std::size_t count = count_;
  if (scratch.excess.size() < count) scratch.excess.resize(2 * count);
  double* const excess = scratch.excess.data();
  std::size_t worst = 0;
  for (std::size_t v = 0; v < count; ++v) {
    excess[v] = Excess(v, normal, offset, step);
    if (excess[v] > excess[worst]) worst = v;
  }
  if (!(excess[worst] > 0)) return false;
  std::size_t first = worst, last = worst, cut = 1;
  for (; excess[Previous(first)] > 0; first = Previous(first))
    if (++cut == count) return false;
  for (; excess[Next(last)] > 0; last = Next(last))
    if (++cut == count) return false;

  struct Created {
    double x[2];
    std::vector<double> centre;
    bool judged = false;
  } created[2];
  const auto locate = [&](std::size_t facet, std::size_t kept, std::size_t removed, Created& v) {
    const std::uint32_t side = this->id(facet);
    if (centres_) {
      v.centre.resize(centres_->d);
      const std::uint32_t points[2] = {side, id};
      v.judged = around.Centre(points, Mix64(side) + Mix64(id), v.x, v.centre.data());
      if (v.judged) return;
    }
    double side_normal[2];
    const double side_offset = around.HalfSpace(side, side_normal);
    HalfSpaceRef<2> planes[2] = {{side, side_normal, side_offset}, {id, normal, offset}};
    Meet<2>(planes, {x(kept), norm2(kept), excess[kept]},
            {x(removed), norm2(removed), excess[removed]}, centres_ ? kJudgedSlack : kSlack, v.x);
    if (centres_) around.Lift(v.x, v.centre.data());
  };
  const std::size_t after = Next(last);
  locate(first, Previous(first), first, created[0]);
  locate(after, after, last, created[1]);

  Rotate(after);
  const std::size_t kept = count - cut;
  Resize(kept + 2);
  ids()[kept + 1] = id;
  for (std::size_t e = 0; e < 2; ++e) {
    std::copy_n(created[e].x, 2, corners() + 2 * (kept + e));
    if (!centres_) continue;
    std::copy_n(created[e].centre.data(), centres_->d,
                centres_->at.data() + (kept + e) * centres_->d);
    centres_->judged[kept + e] = created[e].judged;
  }
  Measure();
  return true;
}

// Makes room for, or leaves, so many vertices.
void Polygon::Resize(std::size_t count) {
  if (count > kInline) {
    if (!outside_) {
      outside_ = std::make_unique<Outside>();
      outside_->corners.assign(corners_, corners_ + 2 * kInline);
      outside_->ids.assign(ids_, ids_ + kInline);
    }
    outside_->corners.resize(2 * count);
    outside_->ids.resize(count);
  } else if (outside_) {
    std::copy_n(outside_->corners.data(), 2 * count, corners_);
    std::copy_n(outside_->ids.data(), count, ids_);
    outside_.reset();
  }
  if (centres_) {
    centres_->at.resize(count * centres_->d);
    centres_->judged.resize(count);
  }
  count_ = static_cast<Index>(count);
}

// Begins to count vertices and facets from `first`.
void Polygon::Rotate(std::size_t first) {
  if (first == 0) return;
  std::rotate(ids(), ids() + first, ids() + count_);
  std::rotate(corners(), corners() + 2 * first, corners() + 2 * std::size_t{count_});
  if (!centres_) return;
  auto& at = centres_->at;
  auto& judged = centres_->judged;
  std::rotate(at.begin(), at.begin() + static_cast<std::ptrdiff_t>(first * centres_->d), at.end());
  std::rotate(judged.begin(), judged.begin() + static_cast<std::ptrdiff_t>(first), judged.end());
}

void Polygon::Measure() {
  max_norm2_ = 0;
  for (std::size_t v = 0; v < count_; ++v) max_norm2_ = std::max(max_norm2_, norm2(v));
  has_fake_ = has_fake_ && std::any_of(ids(), ids() + count_, IsFake);
}

}  // namespace stellate::core
