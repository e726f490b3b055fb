#include "core/geometry/restricted_voronoi_polygon.h"

#include <cmath>
#include <span>

#include "core/geometry/draft_polygon.h"
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

void Polygon::PackTo(std::vector<std::byte>* message) const {
  Pack(count_, message);
  Pack(has_fake_, message);
  Pack(max_norm2_, message);
  Pack(std::span(corners(), 2 * std::size_t{count_}), message);
  Pack(std::span(ids(), count_), message);
  Pack(centres_ ? centres_->d : 0, message);
  if (!centres_) return;
  PackAll(centres_->at, message);
  PackAll(centres_->judged, message);
}

void Polygon::Unpack(Parcel* parcel) {
  Resize(parcel->Unpack<Index>());
  has_fake_ = parcel->Unpack<bool>();
  max_norm2_ = parcel->Unpack<double>();
  parcel->Unpack(2 * std::size_t{count_}, corners());
  parcel->Unpack(count_, ids());
  const auto d = parcel->Unpack<std::size_t>();
  centres_.reset();
  if (d == 0) return;
  centres_ = std::make_unique<Centres>();
  centres_->d = d;
  parcel->UnpackAll(&centres_->at);
  parcel->UnpackAll(&centres_->judged);
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

void Polygon::Take(const DraftPolygon& polygon) {
  centres_.reset();
  Resize(polygon.count());
  double* const x = corners();
  std::uint32_t* const id = ids();
  has_fake_ = false;
  for (std::size_t v = 0; v < count_; ++v) {
    x[2 * v] = polygon.x(v);
    x[2 * v + 1] = polygon.y(v);
    id[v] = polygon.id(v);
    has_fake_ = has_fake_ || IsFake(id[v]);
  }
  max_norm2_ = polygon.max_norm2();
}

// A cut removes a chain of vertices of a polygon, from `first` to `last`; two new ones close the
// gap.
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

  // The created take the place of the chain, or, where it goes over the end, come last.
  const bool over_end = first > last;
  const std::size_t size = count - cut + 2;
  const std::size_t place = over_end ? size - 2 : first;
  const std::uint32_t side = ids()[first];
  if (size > count) Resize(size);
  Move(last + 1, over_end ? first : count, over_end ? 0 : first + 2);
  if (size < count) Resize(size);
  ids()[place] = side;
  ids()[place + 1] = id;
  for (std::size_t e = 0; e < 2; ++e) {
    std::copy_n(created[e].x, 2, corners() + 2 * (place + e));
    if (!centres_) continue;
    std::copy_n(created[e].centre.data(), centres_->d,
                centres_->at.data() + (place + e) * centres_->d);
    centres_->judged[place + e] = created[e].judged;
  }
  Measure();
  return true;
}

// Sets the number of vertices. Moves back inside only with some to spare: the number goes up and
// down while a cell is clipped.
void Polygon::Resize(std::size_t count) {
  if (count > kInline || (outside_ && count + kSpare > kInline)) {
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

// Moves the vertices [begin, end), each with its first facet, to the places from `to` on.
void Polygon::Move(std::size_t begin, std::size_t end, std::size_t to) {
  const auto move = [&](auto* items, std::size_t width) {
    auto* const first = items + begin * width;
    auto* const last = items + end * width;
    if (to < begin)
      std::copy(first, last, items + to * width);
    else
      std::copy_backward(first, last, items + (to + end - begin) * width);
  };
  if (to == begin) return;
  move(ids(), 1);
  move(corners(), 2);
  if (!centres_) return;
  move(centres_->at.data(), centres_->d);
  move(centres_->judged.data(), 1);
}

void Polygon::Measure() {
  max_norm2_ = 0;
  if (centres_) {
    for (std::size_t v = 0; v < count_; ++v) max_norm2_ = std::max(max_norm2_, norm2(v));
  } else {
    const double* const x = corners();
    for (std::size_t i = 0; i < 2 * std::size_t{count_}; i += 2)
      max_norm2_ = std::max(max_norm2_, x[i] * x[i] + x[i + 1] * x[i + 1]);
  }
  has_fake_ = has_fake_ && std::any_of(ids(), ids() + count_, IsFake);
}

}  // namespace stellate::core
