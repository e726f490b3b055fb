#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/base/random.h"
#include "core/base/vector_ops.h"
#include "core/complex/centre_cache.h"
#include "core/index/indexed_points.h"
#include "core/walls.h"

namespace stellate::core {

// A point of M with its tangent basis: one of the sample, or one that may join it.
struct Site {
  std::uint32_t id;       // of a point that may join: the sample's size
  const double* point;    // d
  const double* tangent;  // K rows of d, orthonormal
  WallSet walls = 0;      // that the point is on
  // K tangent coordinates for each of the walls, ascending: the outward unit normal of the wall in
  // T_pM.
  const double* conormals = nullptr;
};

// Working memory for q - p, on the stack where d is small.
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

// The sample: points of M with tangent bases, walls, names and weights, and the trees that search
// them. It knows no stars, only for each point how far its star can be influenced, which Stars
// sets. A value: a copy goes on by itself.
//
//   Sample<2> sample(3, epsilon);
//   sample.Add(point, tangent);                          // gets the id 0
//   sample.ForEachWithin(q, radius, [](std::uint32_t id) { ... });
//
// Ids count up from 0; points are never removed. Const calls may run in parallel.
template <int K>
class Sample {
 public:
  // d        ambient dimension
  // epsilon  the size bound, length: sets the scale of the perturbing weights
  Sample(int d, double epsilon);

  // Adds a point, which searches find from now on, and returns its id. `walls`, `conormals`: as in
  // Site.
  std::uint32_t Add(const double* point, const double* tangent, WallSet walls = 0,
                    const double* conormals = nullptr);
  // Adds a point inside all walls, which no search finds before Index(). `bound`: the size bound
  // there, length, if it is not epsilon for all; given for each point or for none.
  void AddUnindexed(const double* point, const double* tangent, double bound = 0);
  bool is_indexed() const { return points_.is_indexed(); }
  // Builds the search tree of all points again, none with an influence. `room`: for one part in so
  // many more points memory is kept, and for little more; 0: as it comes.
  void Index(BallTree::Halving halving, std::size_t room = 0);
  // Where this sample is a part of a larger one: sets the name of the point that was added last,
  // which is its id in the whole. A point without a name is called by its id. Weights follow names,
  // so that a part has the stars of the whole. REQUIRES: names ascend; no star of the point is
  // built.
  void NameLast(std::uint32_t name);
  // Sets the protecting balls around points of sharp edges: `radii2` by point, squared radii, 0:
  // none; later points have none. A squared radius is added to the point's weight, so that what
  // lies outside the balls comes no nearer to an edge than the edge's own points do.
  void SetProtectingBalls(std::vector<double> radii2);

  std::uint32_t size() const { return static_cast<std::uint32_t>(points_.size()); }
  int d() const { return d_; }
  double epsilon() const { return epsilon_; }
  const double* Point(std::uint32_t id) const { return points_.Point(id); }
  // K rows of d: row a is tangent vector a.
  const double* Tangent(std::uint32_t id) const { return tangents_.data() + id * stride() * K; }
  const std::vector<double>& points() const { return points_.coordinates(); }  // d each
  // (d K) x n, entry i*K + a of a column is coordinate i of tangent vector a.
  Eigen::MatrixXd TangentMatrix() const;
  std::uint32_t NameOf(std::uint32_t id) const { return id < names_.size() ? names_[id] : id; }
  // The walls that a point is on.
  WallSet walls(std::uint32_t id) const { return id < walls_.size() ? walls_[id] : 0; }
  // K for each of its walls, ascending.
  const double* Conormals(std::uint32_t id) const {
    return id < walls_.size() ? conormals_.data() + conormals_at_[id] : nullptr;
  }
  Site At(std::uint32_t id) const { return {id, Point(id), Tangent(id), walls(id), Conormals(id)}; }

  bool has_protecting_balls() const { return largest_protecting_radius2_ > 0; }
  double largest_protecting_radius2() const {
    return largest_protecting_radius2_;
  }  // squared radius
  // Squared radius; 0: the point has none.
  double ProtectingRadius2(std::uint32_t id) const {
    return id < protecting_radii2_.size() ? protecting_radii2_[id] : 0;
  }
  bool InProtectingBall(const double* point) const;
  // Cospherical points would have every star decide alone how to split them; weights this much
  // larger than rounding, and this much smaller than anything geometric, make all decide alike.
  double Weight(std::uint32_t id) const {
    // Of a signed number, which takes an instruction where an unsigned one takes a branch.
    const auto bits = static_cast<std::int64_t>(Mix64(NameOf(id)) >> 11);
    return weight_scale_ * (static_cast<double>(bits) * 0x1p-53) + ProtectingRadius2(id);
  }
  // The size bound at a point: how far to look at first for what cuts its star.
  double BoundAt(std::uint32_t id) const { return bounds_.empty() ? epsilon_ : bounds_[id]; }
  void ForgetBounds() { bounds_ = {}; }
  // Whose common centres are kept in a CentreCache: changes whenever the weights do.
  std::uint64_t centre_owner() const { return centre_owner_.id(); }

  // Writes q in p's tangent coordinates, normal = T_p^t (q - p), and returns |q - p|^2.
  double Project(std::uint32_t p, const double* q, double* normal) const {
    Step step(d_);
    return Project(At(p), q, step.data(), normal);
  }
  // Also writes step = q - p, d numbers.
  double Project(const Site& p, const double* q, double* step, double* normal) const {
    return WithDimension(d_, [&](auto known) {
      const int d = known() > 0 ? known() : d_;
      for (int i = 0; i < d; ++i) step[i] = q[i] - p.point[i];
      for (int a = 0; a < K; ++a) normal[a] = Dot(p.tangent + a * d, step, d);
      return Dot(step, step, d);
    });
  }
  // Writes p + T_p x.
  void Lift(std::uint32_t p, const double* x, double* point) const;

  // Whether some point lies within `radius` of q.
  bool AnyWithin(const double* q, double radius) const { return tree().AnyWithin(q, radius); }
  // Calls visit(id) for each point within `radius` of q.
  template <typename Visit>
  void ForEachWithin(const double* q, double radius, Visit&& visit) const {
    tree().VisitNear(
        q, [&] { return radius; }, [&](std::uint32_t id, double) { visit(id); });
  }
  // Writes the `count` points nearest to q as (squared distance, id), nearest first, and returns
  // how many there are.
  int Nearest(const double* q, int count, std::pair<double, std::uint32_t>* nearest) const;
  // Sort points by place, and each is mostly near the one before it.
  std::uint32_t PlaceOf(std::uint32_t id) const { return tree().PlaceOf(id); }

  // A point's influence is how far from it a point may be that changes its star.
  const BallTree& tree() const { return points_.tree(); }
  BallTree& tree() { return points_.tree(); }
  // The points on walls, ascending, and their tree, by place in boundary(): a point's influence is
  // there that on its star's simplices of faces.
  const std::vector<std::uint32_t>& boundary() const { return boundary_; }
  const BallTree& boundary_tree() const { return boundary_points_.tree(); }
  BallTree& boundary_tree() { return boundary_points_.tree(); }

 private:
  std::size_t stride() const { return static_cast<std::size_t>(d_); }

  int d_;
  double epsilon_, weight_scale_;
  IndexedPoints points_;
  std::vector<double> tangents_;
  std::vector<std::uint32_t> names_;  // up to the last that is not its point's id
  // Of manifolds with boundary, up to the last point on a wall; else empty.
  std::vector<WallSet> walls_;
  std::vector<std::uint32_t> conormals_at_;
  std::vector<double> conormals_;
  std::vector<double> protecting_radii2_;  // squared radii, by point, up to the last; or empty
  double largest_protecting_radius2_ = 0;
  std::vector<double> bounds_;  // size bounds, by point, until ForgetBounds(); or empty
  std::vector<std::uint32_t> boundary_;
  IndexedPoints boundary_points_;
  typename CentreCache<K>::Owner centre_owner_;
};

STELLATE_DECLARE_CLASS(Sample)

}  // namespace stellate::core
