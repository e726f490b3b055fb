#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/complex/blocks.h"
#include "core/complex/centre_cache.h"
#include "core/geometry/restricted_voronoi_cell.h"
#include "core/sample/ball_tree.h"
#include "core/specification.h"

namespace stellate::core {

// The sample and the star of each of its points (Sec. 5.2.1): star(p) is kept as its dual, the
// Voronoi cell of p restricted to T_pM. The mesh is the union of the stars.
//
// Ids count up from 0; points are never removed. Const calls may run in parallel.
template <int K>
class StarComplex {
 public:
  using Cell = RestrictedVoronoiCell<K>;
  using Simplex = std::array<std::uint32_t, K + 1>;  // ascending ids

  // d         ambient dimension
  // epsilon   the size bound, length: sets the scale of the perturbing weights
  // inradius  of the fake simplex that each cell begins as, length
  // judging   where a simplex is judged: see Judging
  StarComplex(int d, double epsilon, double inradius, Judging judging);
  StarComplex(const StarComplex& other);
  StarComplex& operator=(const StarComplex&) = delete;

  // What an insertion did.
  struct Change {
    // Old stars that changed, neighbours mostly after each other; new ones are not among them.
    std::vector<std::uint32_t> stars;
    std::vector<std::uint32_t> added,
        removed;  // simplices held by their lowest vertex, K+1 ids each
  };

  static constexpr std::uint32_t kNone = 0xffffffffu;

  // A point waiting to be inserted by Commit. Later calls of AnyWithin see it. `near`, if known, is
  // a sample point whose star it will change: its cell is found sooner. The cell is the same where
  // stars are judged in flats; at common centres the order of the cuts may tell in a cell that is
  // far from convex.
  // A point of the boundary comes with the walls that it is on and their conormals, K tangent
  // coordinates each by ascending wall: the outward unit normals of the walls in T_pM.
  std::uint32_t Append(const double* point, const double* tangent, std::uint32_t near = kNone,
                       WallSet walls = 0, const double* conormals = nullptr);
  // A point of a sample that is there before any star of it: no search finds it before Commit,
  // which builds all stars, those that there are anew. They then hang on the points within reach
  // alone: a part of the sample, with all points that far around it, has the stars of the whole,
  // bit for bit, if its points keep their order and their names (NameLast). REQUIRES: nothing
  // waits for a Commit but what was laid, and the point is on no wall.
  void Lay(const double* point, const double* tangent);
  // Of a part of a sample: the name of the point that was laid or appended last, which is its id in
  // the whole. Until then a point's name is its id. REQUIRES: names ascend.
  void NameLast(std::uint32_t name);
  std::uint32_t NameOf(std::uint32_t id) const { return id < names_.size() ? names_[id] : id; }
  // The size bound at the point that was laid last, where it is not epsilon for all; said of each
  // or of none. It is where to look for what cuts its star, never what does.
  void LaidAt(double bound) { laid_bounds_.push_back(bound); }
  // While the faces of a boundary are meshed by themselves: stars are known no farther out than
  // their simplices of faces are, and have no others. What is inside would reach from one side of M
  // to the other. From the next Commit after FollowAll on they are whole, all built anew.
  void FollowFacesAlone() { faces_alone_ = true; }
  void FollowAll() { becomes_whole_ = faces_alone_; }
  // Builds the stars of the appended points and clips all others by them, in parallel; the result
  // does not depend on the number of threads. `around`, if given, gets the neighbours that changed
  // stars have or had (with repetitions): their simplices may have become inconsistent.
  Change Commit(std::vector<std::uint32_t>* around = nullptr);

  std::uint32_t size() const { return static_cast<std::uint32_t>(points_.size() / stride()); }
  int d() const { return d_; }
  double inradius() const { return inradius_; }
  Judging judging() const { return judging_; }
  const double* Point(std::uint32_t id) const { return points_.data() + id * stride(); }
  // K rows of d: row a is tangent vector a.
  const double* Tangent(std::uint32_t id) const { return tangents_.data() + id * stride() * K; }
  const Cell& cell(std::uint32_t id) const { return cells_[id]; }
  // The walls that a point is on.
  WallSet walls(std::uint32_t id) const { return id < walls_.size() ? walls_[id] : 0; }
  // K for each of its walls, ascending.
  const double* Conormals(std::uint32_t id) const {
    return id < walls_.size() ? conormals_.data() + conormals_at_[id] : nullptr;
  }

  // Guards: balls around points of sharp edges, whose squared radii are the points' weights. What
  // lies outside of them comes nowhere nearer to an edge than its own points do, however sharp it
  // is. `radii2` by point, 0: none; later points have none. All stars are built anew.
  // REQUIRES: nothing waits for a Commit.
  void Guard(std::vector<double> radii2);
  bool has_guards() const { return largest_guard_ > 0; }
  // Squared radius; 0: the point has none.
  double GuardOf(std::uint32_t id) const { return id < guards_.size() ? guards_[id] : 0; }
  bool InGuard(const double* point) const;
  // Whether p or a sample point of a facet at vertex v of its cell is guarded.
  bool TouchesGuard(std::uint32_t p, const Cell& cell, std::size_t v) const {
    if (!has_guards()) return false;
    bool touches = GuardOf(p) > 0;
    for (int s = 0; s < K; ++s) {
      const std::uint32_t id = cell.id(cell.facet(v, s));
      touches = touches || (IsSample(id) && GuardOf(id) > 0);
    }
    return touches;
  }

  // The k-simplex dual to vertex v of p's cell, or false if a facet of it is fake or a wall.
  bool SimplexOf(std::uint32_t p, const Cell& cell, std::size_t v, Simplex* simplex) const {
    (*simplex)[0] = p;
    for (int s = 0; s < K; ++s) {
      const std::uint32_t id = cell.id(cell.facet(v, s));
      if (!IsSample(id)) return false;
      std::size_t at = static_cast<std::size_t>(s) + 1;
      for (; at > 0 && (*simplex)[at - 1] > id; --at) (*simplex)[at] = (*simplex)[at - 1];
      (*simplex)[at] = id;
    }
    return true;
  }
  // What vertex v of p's cell is dual to: a simplex of the face of its walls.
  struct FaceSimplex {
    Simplex ids;        // the first `count`, ascending
    int count = 0;      // its dimension, and one
    WallSet walls = 0;  // of the vertex
    bool fake = false;  // a facet is: it is no simplex yet
    // A vertex of it is not on the face: a point off the face is nearer to the vertex than the
    // face's own.
    bool foreign = false;
    int dimension() const { return K - CountWalls(walls); }
  };
  // `guest_walls`: of the point with the id size(), if a facet is its.
  FaceSimplex FaceSimplexOf(std::uint32_t p, const Cell& cell, std::size_t v,
                            WallSet guest_walls = 0) const;

  // A vertex of a star's cell.
  struct CellVertex {
    std::uint32_t star;
    std::size_t vertex;
  };
  // The vertex dual to a simplex of a face of lower dimension that a point on the face of `walls`
  // would cut off, off that face: of the lowest dimension, and there the farthest out. Nothing: it
  // encroaches on no face.
  std::optional<CellVertex> EncroachedBy(const double* point, WallSet walls) const;

  // The half-space of a facet of p's cell: writes the normal, T_p^t (q - p), returns the offset.
  double HalfSpace(std::uint32_t p, std::size_t facet, double* normal) const;
  // |q - p|^2 for the sample point q of a facet of p's cell, without the weights' share.
  double EdgeLength2(std::uint32_t p, std::size_t facet) const;

  // Whether some sample point lies within `radius` of q.
  bool AnyWithin(const double* q, double radius) const;

  // visit(id) for each sample point within `radius` of q.
  template <typename Visit>
  void ForEachWithin(const double* q, double radius, Visit&& visit) const {
    tree_.VisitNear(
        q, [&] { return radius; }, [&](std::uint32_t id, double) { visit(id); });
  }

  // The `count` sample points nearest to q as (squared distance, id), nearest first; returns how
  // many there are.
  int Nearest(const double* q, int count, std::pair<double, std::uint32_t>* nearest) const;

  // Points in the order of their places are mostly near the ones before them.
  std::uint32_t PlaceOf(std::uint32_t id) const { return tree_.PlaceOf(id); }

  // Whether a point would take the simplex dual to a vertex of p's cell out of star(p).
  bool CutsVertex(std::uint32_t p, std::size_t vertex, const double* point) const;

  // q in p's tangent coordinates: normal = T_p^t (q - p), the return value |q - p|^2.
  double Project(std::uint32_t p, const double* q, double* normal) const;
  // p + T_p x.
  void Lift(std::uint32_t p, const double* x, double* point) const;

  // The cells as they would be with one more point: its own, and those that it would cut,
  // ascending by id. Const: the complex does not change.
  struct Tentative {
    Cell own;
    std::vector<std::pair<std::uint32_t, Cell>> cut;
  };
  void TryPoint(const double* point, const double* tangent, std::uint32_t near,
                typename Cell::Scratch& scratch, Tentative* result, WallSet walls = 0,
                const double* conormals = nullptr) const;

  // Simplices held by the star of their lowest vertex.
  std::vector<std::uint32_t> Simplices() const;
  std::uint64_t simplex_count() const { return simplex_count_; }

  const std::vector<double>& points() const { return points_; }  // d each
  // (d K) x n, entry i*K + a of a column is coordinate i of tangent vector a.
  Eigen::MatrixXd TangentMatrix() const;

 private:
  // Simplices of a larger circumradius, in epsilon, are judged in the flats: far out the common
  // centre is no better, and they will be refined anyway.
  static constexpr double kJudgedRadius = 1.3;

  std::size_t stride() const { return static_cast<std::size_t>(d_); }
  // Cospherical points would have every star decide alone how to split them; weights this much
  // larger than rounding, and this much smaller than anything geometric, make all decide alike.
  double Weight(std::uint32_t id) const {
    // Of a signed number, which takes an instruction where an unsigned one takes a branch.
    const auto bits = static_cast<std::int64_t>(Mix64(NameOf(id)) >> 11);
    return weight_scale_ * (static_cast<double>(bits) * 0x1p-53) + GuardOf(id);
  }
  // A point with its tangent basis, in the sample or not yet.
  struct Site {
    std::uint32_t id;
    const double* point;
    const double* tangent;
    WallSet walls = 0;
    const double* conormals = nullptr;  // K for each of the walls
  };
  class Around;
  Site At(std::uint32_t id) const { return {id, Point(id), Tangent(id), walls(id), Conormals(id)}; }
  // Clips the cell of p by q, or only says whether it would. `guest` is a site that may be named by
  // the cell's facets without being in the sample. `born`: the star of q, if it is there already,
  // where centres may be looked up.
  bool ClipBy(Cell& cell, const Site& p, const Site& q, const Site* guest, const Cell* born,
              typename Cell::Scratch& scratch) const;
  bool Cuts(const Cell& cell, const Site& p, const Site& q) const;
  // Of a cell that is judged at common centres only when it is done.
  void ResetInFlats(Cell& cell, const Site& p) const;
  bool ClipInFlats(Cell& cell, const Site& p, const Site& q, typename Cell::Scratch& scratch) const;
  using Near = std::vector<std::pair<double, std::uint32_t>>;  // by squared distance
  // Judges it. Whether its vertices are those that it has there, too: none of `near`, the points
  // within reach, is nearer to a common centre than the simplex' own.
  bool JudgeCell(Cell& cell, const Site& p, const Near& near) const;
  double Project(const Site& p, const double* q, double* step, double* normal) const;
  double HalfSpace(const Site& p, const Site& q, double* step, double* normal) const {
    return 0.5 * (Project(p, q.point, step, normal) + Weight(p.id) - Weight(q.id));
  }
  // Of a cell in the flats that is made apart. Whether q cuts it.
  template <typename Polytope>
  bool ClipApart(const Site& p, std::uint32_t q, double* step, Polytope* polytope) const {
    double normal[K];
    const double offset = HalfSpace(p, At(q), step, normal);
    return polytope->Clip(q, normal, offset);
  }
  // The cell of p before any other point is known.
  void ResetCell(Cell& cell, const Site& p, const Site* guest,
                 typename Cell::Scratch& scratch) const;
  // Builds p's cell, and calls influencing(q) for each sample point whose cell p may cut.
  template <typename Influencing>
  void BuildStar(const Site& p, const Site* guest, std::uint32_t near, Cell& cell,
                 typename Cell::Scratch& scratch, const Influencing& influencing) const;
  template <typename Influencing>
  bool BuildAsInFlats(const Site& p, std::uint32_t near, Cell& cell,
                      const Influencing& influencing) const;
  template <typename Influencing>
  bool BuildPolytope(const Site& p, std::uint32_t near, Cell& cell,
                     const Influencing& influencing) const;
  void BuildNearestFirst(const Site& p, const Site* guest, Cell& cell,
                         typename Cell::Scratch& scratch) const;
  void CloseInFlats(const Site& p, Cell& cell, typename Cell::Scratch& scratch) const;
  void Neighbourhood(const double* q, std::uint32_t near, std::vector<std::uint32_t>* ids) const;
  // Calls clip(q) for each q of p's Neighbourhood, and returns that.
  template <typename Clip>
  const std::vector<std::uint32_t>& ClipByNeighbourhood(const Site& p, std::uint32_t near,
                                                        const Clip& clip) const;
  // Calls visit(v, simplex) for the simplices of star(p) of which p is the lowest vertex, once for
  // each: at common centres a cell that is far from convex may hold one at two vertices.
  template <typename Visit>
  void ForEachOwned(std::uint32_t p, const Visit& visit) const {
    if (faces_alone_) return;
    const Cell& cell = cells_[p];
    if constexpr (K == 2) {
      if (judging_ == Judging::kFlats) return ForEachOwnedTriangle(p, cell, visit);
    }
    Simplex simplex;
    thread_local std::vector<std::uint64_t> keys;
    keys.clear();
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      bool lowest = true;
      for (int i = 0; i < K; ++i) lowest = lowest && cell.id(cell.facet(v, i)) > p;
      if (!lowest || !SimplexOf(p, cell, v, &simplex)) continue;
      if (judging_ == Judging::kCommonCentre) {
        if (std::find(keys.begin(), keys.end(), cell.key(v)) != keys.end()) continue;
        keys.push_back(cell.key(v));
      }
      visit(v, simplex);
    }
  }
  template <typename Visit>
  static void ForEachOwnedTriangle(std::uint32_t p, const Cell& cell, const Visit& visit) {
    const std::size_t count = cell.facet_count();
    const auto is_above = [p](std::uint32_t q) { return q > p && IsSample(q); };
    for (std::size_t v = 0; v < count; ++v) {
      const std::uint32_t a = cell.id(v), b = cell.id(v + 1 < count ? v + 1 : 0);
      if (is_above(a) && is_above(b)) visit(v, a < b ? Simplex{p, a, b} : Simplex{p, b, a});
    }
  }
  // Commit, step by step.
  struct Cut {
    std::uint32_t star, by;
    bool operator<(const Cut& other) const {
      return star != other.star ? star < other.star : by < other.by;
    }
  };
  struct Turn {
    std::uint32_t first, star;  // the first new point that cuts the star
    std::size_t begin, end;     // its cuts
    bool operator<(const Turn& other) const {
      return first != other.first ? first < other.first : star < other.star;
    }
  };
  std::vector<Cut> BuildNewStars(std::uint32_t first);
  // Clips the cell of p by new points; for K = 2 in the flats.
  void CutStar(std::uint32_t p, std::span<const Cut> cuts);
  void CutPolygon(std::uint32_t p, std::span<const Cut> cuts);
  // From one point to the next, as if all had come at once.
  Change BuildAllStars();
  // Where a sample was laid: every star is built once, from what lies around it.
  Change BuildLaidStars();
  void BuildAllLaidStars(double* influence);  // by id
  // `ids`: at least what lies as far around as a laid star is looked for at once.
  void BuildLaidStar(std::uint32_t p, const std::vector<std::uint32_t>& ids, Cell& cell) const;
  template <typename Laid>
  void BuildLaidStarFrom(std::uint32_t p, Laid& around, Cell& cell) const;
  double LaidBound(std::uint32_t p) const {
    return laid_bounds_.empty() ? epsilon() : laid_bounds_[p];
  }
  // The same for K = 2 in the flats: of all of them, or of bunches that lie together.
  void BuildAllLaidPolygons(double* influence);
  void BuildLaidPolygons(std::span<const BallTree::Bunch> bunches, double* influence);
  template <typename Search>
  void CutInFlats(const Site& p, Near* near, double* known, const Search& search, Cell& cell,
                  typename Cell::Scratch& scratch) const;
  template <typename Search>
  bool BuildInFlats(const Site& p, Near* near, double* known, const Search& search, Cell& cell,
                    typename Cell::Scratch& scratch) const;
  static std::vector<Turn> InTurns(const std::vector<Cut>& cuts);
  void CutStars(const std::vector<Turn>& turns, const std::vector<Cut>& cuts, std::uint32_t first,
                Change* change);
  // What is known of the boundary's stars besides, after some stars changed.
  void MeasureFaces(const std::vector<Turn>& turns, std::uint32_t first);
  double epsilon() const { return std::sqrt(judged_radius2_) / kJudgedRadius; }
  // The same for a cell of that max_norm2, where there are no guards.
  static double InfluenceWithin(double most2) { return 2 * std::sqrt(most2) * (1 + 1e-9); }
  // How far from p a point may be whose bisector cuts its cell, as far as that is followed.
  double Influence(std::uint32_t p, const Cell& cell) const {
    return Influence(p, faces_alone_ ? MaxNorm2OnFaces(cell) : cell.max_norm2());
  }
  static double MaxNorm2OnFaces(const Cell& cell);
  // ... or cuts vertices that are no farther out.
  double Influence(std::uint32_t p, double most2) const {
    if (!has_guards()) return InfluenceWithin(most2);
    const double power2 = std::max(most2 - GuardOf(p) + largest_guard_, 0.0);
    return (std::sqrt(most2) + std::sqrt(power2)) * (1 + 1e-9);
  }

  int d_;
  double inradius_;
  Judging judging_;
  double judged_radius2_;
  double weight_scale_;
  std::uint64_t centre_owner_ = CentreCache<K>::NewOwner();
  std::vector<double> points_, tangents_;
  std::vector<std::uint32_t> names_;  // up to the last that is not its point's id
  // Of manifolds with boundary, up to the last point of it; else empty.
  std::vector<WallSet> walls_;
  std::vector<std::uint32_t> conormals_at_;
  std::vector<double> conormals_;
  std::vector<double> guards_;  // squared radii, by point, up to the last; or empty
  double largest_guard_ = 0;
  Blocks<Cell> cells_;
  std::vector<std::uint32_t> near_;  // of the appended points
  std::vector<double> laid_bounds_;  // of the laid points, until they have stars; or empty
  BallTree tree_;
  // The points of the boundary, ascending, with the influence of their stars' simplices of faces.
  std::vector<std::uint32_t> boundary_;
  std::vector<double> boundary_points_;
  BallTree boundary_tree_;
  bool faces_alone_ = false, becomes_whole_ = false;
  std::uint64_t simplex_count_ = 0;
};

template <>
void StarComplex<2>::CutPolygon(std::uint32_t p, std::span<const Cut> cuts);
template <>
void StarComplex<2>::BuildAllLaidPolygons(double* influence);
template <>
void StarComplex<2>::BuildLaidPolygons(std::span<const BallTree::Bunch> bunches, double* influence);

STELLATE_DECLARE_CLASS(StarComplex)

}  // namespace stellate::core
