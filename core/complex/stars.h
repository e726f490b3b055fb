#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/base/parcel.h"
#include "core/complex/blocks.h"
#include "core/complex/sample.h"
#include "core/complex/star_builder.h"
#include "core/geometry/restricted_voronoi_cell.h"
#include "core/peers.h"
#include "core/specification.h"

namespace stellate::core {

// The stars of a growing sample (Sec. 5.2.1): star(p) is stored as its dual, the Voronoi cell of p
// restricted to T_pM. The mesh is the union of the stars. Add points, then Commit(): stars and
// counts do not change in between. A value: a copy has the same state and is independent.
//
//   Stars<2> stars(3, epsilon, {.inradius = 10 * epsilon});
//   for (...) stars.Add(point, tangent);
//   const Stars<2>::Change change = stars.Commit();  // simplices added and removed
//   stars.cell(0).max_norm2();                       // of the star of the first point
//   stars.sample().Point(0);
//
// Ids are those of the sample's points. Const calls may run in parallel.
template <int K>
class Stars {
 public:
  using Cell = RestrictedVoronoiCell<K>;
  using Simplex = std::array<std::uint32_t, K + 1>;  // ascending ids

  // d        ambient dimension
  // epsilon  the size bound, length: sets the scale of the perturbing weights
  // labels   of an arrangement of walls: a point on walls then has a cell for each of its sectors
  // peers    the parts that build the stars together, each all of them; borrowed
  Stars(int d, double epsilon, const StarOptions& options, LabelTable labels = {},
        const Peers& peers = NoPeers())
      : options_(options), peers_(&peers), sample_(d, epsilon, std::move(labels)) {}

  static constexpr std::uint32_t kNone = 0xffffffffu;

  // Adds a point, whose star the next Commit builds, and returns its id; searches of the sample
  // find it immediately. `walls`, `conormals`, `signs`: as in Site. `near`: a sample point whose
  // star the new one will change, if one is known, which makes building faster. The star in the
  // tangent space is the same; at common centres the order of the cuts may matter in a cell that is
  // far from convex.
  std::uint32_t Add(const double* point, const double* tangent, std::uint32_t near = kNone,
                    WallSet walls = 0, const double* conormals = nullptr, WallSet signs = 0) {
    near_.push_back(near);
    const std::uint32_t id = sample_.Add(point, tangent, walls, conormals, signs);
    if (!sample_.sectors().labels().empty()) NoteSectors(id);
    return id;
  }
  // Adds a point inside all walls that no search finds before Commit. The next Commit rebuilds all
  // stars together (BulkStarBuilder): cheaper if most of a sample is added in this way. `bound`: as
  // in Sample::AddUnindexed. REQUIRES: all points that wait for Commit were added in this way.
  void AddInBulk(const double* point, const double* tangent, double bound = 0) {
    sample_.AddUnindexed(point, tangent, bound);
  }
  // See Sample::NameLast. REQUIRES: the point added last waits for Commit.
  void NameLast(std::uint32_t name) { sample_.NameLast(name); }
  // Starts boundary-only mode: stars contain only simplices of boundary faces (StarOptions).
  // REQUIRES: there are no stars yet.
  void RestrictToBoundary() { options_.boundary_only = true; }
  // Ends boundary-only mode: the next Commit rebuilds all stars, whole.
  void IncludeInterior() { includes_interior_next_ = options_.boundary_only; }
  // Sets protecting balls (Sample::SetProtectingBalls), and rebuilds all stars. REQUIRES: no point
  // waits for Commit.
  void SetProtectingBalls(std::vector<double> radii2);

  // What Commit changed.
  struct Change {
    // Old stars that changed, mostly each near the one before it. New stars are not listed.
    std::vector<std::uint32_t> stars;
    // Simplices in the star of their lowest vertex, K+1 ids each.
    std::vector<std::uint32_t> added, removed;
  };
  // Builds the stars of the added points and clips all others by them, in parallel; the result does
  // not depend on the number of threads. `around`, if given, receives the neighbours that changed
  // stars have or had (with repetitions): their simplices may have become inconsistent.
  Change Commit(std::vector<std::uint32_t>* around = nullptr);

  const Peers& peers() const { return *peers_; }
  // Returns the sample, including the points that wait for Commit; all others have stars.
  const Sample<K>& sample() const { return sample_; }
  std::uint32_t size() const { return sample_.size(); }
  // Whether a point's star is built: it does not wait for Commit.
  bool has_star(std::uint32_t id) const { return id < cells_.size(); }
  CentreRule centre_rule() const { return options_.centre_rule; }
  // `sector`: of the point's sectors.
  const Cell& cell(std::uint32_t id, int sector = 0) const {
    return sector == 0 ? cells_[id]
                       : more_cells_[more_at_[id] + static_cast<std::size_t>(sector) - 1];
  }
  // Simplices in the star of their lowest vertex: K+1 ids each, and how many there are.
  std::vector<std::uint32_t> Simplices() const;
  std::uint64_t simplex_count() const { return simplex_count_; }

  // Writes the k-simplex dual to vertex v of p's cell. Returns false if a facet of it is fake or a
  // wall.
  static bool SimplexOf(std::uint32_t p, const Cell& cell, std::size_t v, Simplex* simplex) {
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
  // The dual of vertex v of p's cell: a simplex of the face of its walls.
  struct FaceSimplex {
    Simplex ids;          // the first `count`, ascending
    int count = 0;        // its dimension, and one
    WallSet walls = 0;    // of its face
    int codimension = 0;  // of that
    bool fake = false;    // a facet is fake: it is no simplex yet
    // A vertex of it is not on the face: a point off the face is nearer to the cell's vertex than
    // the face's own points.
    bool foreign = false;
    int dimension() const { return K - codimension; }
  };
  // `guest_walls`: the walls of the point with the id size(), if it has a facet.
  FaceSimplex FaceSimplexOf(std::uint32_t p, const Cell& cell, std::size_t v,
                            WallSet guest_walls = 0) const;
  // Whether p, or a sample point of a facet at vertex v of its cell, has a protecting ball.
  bool TouchesProtectingBall(std::uint32_t p, const Cell& cell, std::size_t v) const {
    if (!sample_.has_protecting_balls()) return false;
    bool touches = sample_.ProtectingRadius2(p) > 0;
    for (int s = 0; s < K; ++s) {
      const std::uint32_t id = cell.id(cell.facet(v, s));
      touches = touches || (IsSample(id) && sample_.ProtectingRadius2(id) > 0);
    }
    return touches;
  }

  // Writes the normal of a facet's half-space in p's cell, T_p^t (q - p), and returns its offset.
  double HalfSpace(std::uint32_t p, std::size_t facet, double* normal, int sector = 0) const;
  // Returns |q - p|^2 for the sample point q of a facet of p's cell, without the weights' share.
  double EdgeLength2(std::uint32_t p, std::size_t facet) const;

  // A vertex of a star's cell.
  struct CellVertex {
    std::uint32_t star;
    std::size_t vertex;
    int sector = 0;
  };
  // Returns the vertex dual to a simplex of a face of lower dimension that a point on the face of
  // `walls` encroaches on, which its insertion would cut off: the one of the lowest dimension, and
  // among these the farthest out. Nothing if the point encroaches on no face.
  std::optional<CellVertex> EncroachedBy(const double* point, WallSet walls) const;
  // Whether inserting a point would remove the simplex dual to a vertex of p's cell from star(p).
  bool CutsVertex(const CellVertex& at, const double* point) const;

  // The cells as they would be with one more point: its own, by sector, and those that it would
  // cut, ascending by star and sector.
  struct Tentative {
    struct Cut {
      std::uint32_t star;
      int sector;
      Cell cell;
    };
    std::vector<Cell> own;
    std::vector<Cut> cut;
  };
  // Writes these cells; the stars do not change. Other arguments: as for Add.
  void TryPoint(const double* point, const double* tangent, std::uint32_t near, Tentative* result,
                WallSet walls = 0, const double* conormals = nullptr, WallSet signs = 0) const;

 private:
  StarBuilder<K> builder() const { return {sample_, options_}; }
  // The three ways of Commit.
  Change BuildAllAsAdded();
  Change BuildAllInBulk();
  Change Insert(std::uint32_t first, std::vector<std::uint32_t>* around);
  // Their steps.
  std::vector<StarCut> BuildNewStars(std::uint32_t first);
  void CutStars(const std::vector<StarCuts>& turns, const std::vector<StarCut>& cuts,
                std::uint32_t first, Change* change);
  void SetInfluences(const std::vector<StarCuts>& turns, std::uint32_t first,
                     const std::vector<double>& influence);
  void MeasureFaces(const std::vector<StarCuts>& turns, std::uint32_t first);
  void NoteSectors(std::uint32_t id);
  Cell& MutableCell(std::uint32_t id, int sector);
  void UnpackCells(std::uint32_t p, Parcel* parcel);
  std::vector<std::pair<Simplex, int>> OwnedInSectors(std::uint32_t p) const;
  double CutSectors(std::uint32_t p, std::span<const StarCut> cuts,
                    std::vector<std::uint32_t>* added, std::vector<std::uint32_t>* removed);
  void FindClosing(const double* q, std::uint32_t near, std::vector<std::uint32_t>* ids) const;
  template <typename Visit>
  void ForEachOwned(std::uint32_t p, int sector, const Visit& visit) const;

  StarOptions options_;
  const Peers* peers_;
  bool includes_interior_next_ = false;
  Sample<K> sample_;
  std::vector<std::uint32_t> near_;  // of the points that wait for Commit
  Blocks<Cell> cells_;               // of each point's first sector
  // Of arrangements: the cells of the other sectors, and where those of each point up to the last
  // that has any begin.
  Blocks<Cell> more_cells_;
  std::vector<std::size_t> more_at_;
  std::size_t more_count_ = 0;
  std::uint64_t simplex_count_ = 0;
};

STELLATE_DECLARE_CLASS(Stars)

}  // namespace stellate::core
