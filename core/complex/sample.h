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
#include "core/complex/sectors.h"
#include "core/index/indexed_points.h"
#include "core/walls.h"

namespace stellate::core {

// A point of M with its tangent basis: a sample point, or one that may join the sample.
struct Site {
  std::uint32_t id;       // the sample's size for a point that may join
  const double* point;    // d
  const double* tangent;  // K rows of d, orthonormal
  WallSet walls = 0;      // the walls that the point is on
  // K tangent coordinates for each of the walls, ascending: the outward unit normal of the wall in
  // T_pM.
  const double* conormals = nullptr;
  // Of an arrangement of walls: the signs of all walls, those that the point is on aside.
  WallSet signs = 0;
  // The walls that bound the star at hand, and those that it is on the negative side of (Sectors):
  // their conormals point into it.
  WallSet bounds = walls;
  WallSet reversed = 0;

  // Returns the same site for its star in a sector.
  Site Towards(const Sector& sector) const {
    Site site = *this;
    site.bounds = sector.bounds;
    site.reversed = walls & ~sector.signs;
    return site;
  }
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
// them. It has no stars, only the influence of each point, which Stars sets. A value: a copy is
// independent.
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
  // labels   of an arrangement of walls
  explicit Sample(int d, double epsilon, LabelTable labels = {});

  // Adds a point, which searches find from now on, and returns its id. `walls`, `conormals`,
  // `signs`: as in Site.
  std::uint32_t Add(const double* point, const double* tangent, WallSet walls = 0,
                    const double* conormals = nullptr, WallSet signs = 0);
  // Adds a point inside all walls, which no search finds before Index(). `bound`: the size bound
  // there, length, if it is not epsilon for all; given for each point or for none.
  void AddUnindexed(const double* point, const double* tangent, double bound = 0);
  bool is_indexed() const { return points_.is_indexed(); }
  // Builds the search tree of all points again, without influences. `parts`: sets the capacity to
  // one part in so many more points, and little more; 0: does not.
  void Index(BallTree::Halving halving, std::size_t parts = 0);
  // Sets the name of the point that was added last, if this sample is a part of a larger one: its
  // id in the whole. A point without a name is called by its id. Weights depend on names, so that a
  // part has the stars of the whole. REQUIRES: names ascend; no star of the point is built.
  void NameLast(std::uint32_t name);
  // Sets the protecting balls around points of sharp edges: `radii2` by point, squared radii, 0:
  // none; later points have none. The squared radius is added to the point's weight, so that no
  // point outside the balls is nearer to an edge, by power, than the edge's own points.
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
  // How many of its walls a face takes (LabelTable).
  int Codimension(WallSet face) const { return sectors_.labels().Codimension(face); }
  // K for each of its walls, ascending.
  const double* Conormals(std::uint32_t id) const {
    return id < walls_.size() ? conormals_.data() + conormals_at_[id] : nullptr;
  }
  // `sector`: of the point's sectors; the site is of its star there.
  Site At(std::uint32_t id, int sector = 0) const {
    const Site site{id, Point(id), Tangent(id), walls(id), Conormals(id), sectors_.Signs(id)};
    return sectors_.labels().empty() ? site : site.Towards(sectors_.At(id, sector));
  }
  const Sectors& sectors() const { return sectors_; }

  bool has_protecting_balls() const { return largest_protecting_radius2_ > 0; }
  double largest_protecting_radius2() const { return largest_protecting_radius2_; }
  // Returns the squared radius of the point's protecting ball; 0: it has none.
  double ProtectingRadius2(std::uint32_t id) const {
    return id < protecting_radii2_.size() ? protecting_radii2_[id] : 0;
  }
  bool InProtectingBall(const double* point) const;
  // Returns the weight of a point. Each star alone would decide how to split cospherical points;
  // weights far larger than rounding, and far smaller than any geometric length, make all stars
  // decide alike.
  double Weight(std::uint32_t id) const {
    // A signed number converts in one instruction, an unsigned one with a branch.
    const auto bits = static_cast<std::int64_t>(Mix64(NameOf(id)) >> 11);
    return weight_scale_ * (static_cast<double>(bits) * 0x1p-53) + ProtectingRadius2(id);
  }
  // Returns the size bound at a point: the first guess how far away points cut its star.
  double BoundAt(std::uint32_t id) const { return bounds_.empty() ? epsilon_ : bounds_[id]; }
  void ForgetBounds() { bounds_ = {}; }
  // Identifies this sample's centres in a CentreCache: changes whenever the weights do.
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

  // A point's influence is how far from it a point may be that changes its star. Points sorted by
  // their places in the tree are mostly near the one before them.
  const BallTree& tree() const { return points_.tree(); }
  BallTree& tree() { return points_.tree(); }
  // The points on walls, ascending, and their tree, by place in boundary(). In it the influence
  // counts only for a star's simplices of faces.
  const std::vector<std::uint32_t>& boundary() const { return boundary_; }
  const BallTree& boundary_tree() const { return boundary_points_.tree(); }
  BallTree& boundary_tree() { return boundary_points_.tree(); }

 private:
  std::size_t stride() const { return static_cast<std::size_t>(d_); }

  int d_;
  double epsilon_, weight_scale_;
  IndexedPoints points_;
  std::vector<double> tangents_;
  std::vector<std::uint32_t> names_;  // up to the last name that is not its point's id
  // For manifolds with boundary, up to the last point on a wall; else empty.
  std::vector<WallSet> walls_;
  std::vector<std::uint32_t> conormals_at_;
  std::vector<double> conormals_;
  Sectors sectors_;
  std::vector<double> protecting_radii2_;  // squared radii, by point, up to the last; or empty
  double largest_protecting_radius2_ = 0;
  std::vector<double> bounds_;  // size bounds, by point, until ForgetBounds(); or empty
  std::vector<std::uint32_t> boundary_;
  IndexedPoints boundary_points_;
  typename CentreCache<K>::Owner centre_owner_;
};

STELLATE_DECLARE_CLASS(Sample)

}  // namespace stellate::core
