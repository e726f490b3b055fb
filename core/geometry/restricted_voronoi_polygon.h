#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/parcel.h"
#include "core/base/random.h"
#include "core/base/vector_ops.h"
#include "core/geometry/surroundings.h"

namespace stellate::core {

class DraftPolygon;

template <int K>
class RestrictedVoronoiCell;  // for any other K: restricted_voronoi_cell.h

// The cell for K = 2, a polygon: vertex v lies on the facets v and v + 1, cyclically. Of a facet
// only the id is kept, and its half-space is computed when a cut needs it, so that millions of
// cells fit in memory: three cache lines each, all in one place, for up to kInline vertices.
// Members as in restricted_voronoi_cell.h.
template <>
class RestrictedVoronoiCell<2> {
 public:
  using Index = std::uint16_t;

  struct Scratch {
    std::vector<double> excess;
  };

  RestrictedVoronoiCell() = default;
  RestrictedVoronoiCell(const RestrictedVoronoiCell& other) { *this = other; }
  RestrictedVoronoiCell(RestrictedVoronoiCell&&) = default;
  RestrictedVoronoiCell& operator=(const RestrictedVoronoiCell& other);
  RestrictedVoronoiCell& operator=(RestrictedVoronoiCell&&) = default;

  void Reset(double inradius, const Surroundings<2>& around);
  // Becomes a polygon that was clipped as a draft; no vertex is judged.
  void Take(const DraftPolygon& polygon);
  bool Clip(std::uint32_t id, const double* normal, double offset, Scratch& scratch,
            const Surroundings<2>& around, const double* step = nullptr);

  void PackTo(std::vector<std::byte>* message) const;
  void Unpack(Parcel* parcel);

  bool WouldCut(const double* normal, double offset, const double* step = nullptr) const {
    for (std::size_t v = 0; v < count_; ++v)
      if (Excess(v, normal, offset, step) > 0) return true;
    return false;
  }
  bool WouldCutVertex(std::size_t v, const double* normal, double offset,
                      const double* step = nullptr) const {
    return Excess(v, normal, offset, step) > 0;
  }

  std::size_t facet_count() const { return count_; }
  std::uint32_t id(std::size_t facet) const { return ids()[facet]; }

  std::size_t vertex_count() const { return count_; }
  const double* x(std::size_t v) const { return corners() + 2 * v; }
  double norm2(std::size_t v) const;
  std::uint64_t key(std::size_t v) const { return Mix64(id(v)) + Mix64(id(Next(v))); }
  std::size_t Find(std::uint64_t wanted, std::size_t from = 0) const {
    while (from < count_ && key(from) != wanted) ++from;
    return from;
  }
  Index facet(std::size_t v, int slot) const { return static_cast<Index>(slot == 0 ? v : Next(v)); }
  Index adjacent(std::size_t v, int slot) const {
    return static_cast<Index>(slot == 0 ? Next(v) : Previous(v));
  }
  bool judged(std::size_t v) const { return centres_ && centres_->judged[v]; }
  const double* Centre(std::size_t v) const { return centres_->at.data() + v * centres_->d; }

  double max_norm2() const { return max_norm2_; }
  bool bounded() const { return !has_fake_; }
  bool HasFakeFacet(std::size_t v) const { return IsFake(id(v)) || IsFake(id(Next(v))); }

  std::size_t Next(std::size_t v) const { return v + 1 < count_ ? v + 1 : 0; }
  std::size_t Previous(std::size_t v) const { return v > 0 ? v - 1 : std::size_t{count_} - 1; }

 private:
  static constexpr std::size_t kInline = 8;
  static constexpr std::size_t kSpare = 2;

  struct Centres {
    std::size_t d;
    std::vector<double> at;            // by vertex, d each, relative to p
    std::vector<std::uint8_t> judged;  // by vertex
  };

  // For more vertices than fit inside: six is the mean, so that few finished cells need it.
  struct Outside {
    std::vector<double> corners;
    std::vector<std::uint32_t> ids;
  };

  const double* corners() const { return outside_ ? outside_->corners.data() : corners_; }
  double* corners() { return outside_ ? outside_->corners.data() : corners_; }
  const std::uint32_t* ids() const { return outside_ ? outside_->ids.data() : ids_; }
  std::uint32_t* ids() { return outside_ ? outside_->ids.data() : ids_; }

  double Excess(std::size_t v, const double* normal, double offset, const double* step) const {
    if (centres_) return Dot(step, Centre(v), static_cast<int>(centres_->d)) - offset;
    return normal[0] * x(v)[0] + normal[1] * x(v)[1] - offset;
  }
  void Resize(std::size_t count);
  void Move(std::size_t begin, std::size_t end, std::size_t to);
  void Measure();

  double corners_[2 * kInline];
  std::uint32_t ids_[kInline];
  std::unique_ptr<Outside> outside_;
  std::unique_ptr<Centres> centres_;  // where vertices are judged
  double max_norm2_ = 0;
  Index count_ = 0;
  bool has_fake_ = true;
};

}  // namespace stellate::core
