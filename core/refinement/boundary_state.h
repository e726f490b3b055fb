#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/boundary/boundary_policy.h"
#include "core/closures.h"
#include "core/refinement/candidate_set.h"
#include "core/walls.h"

namespace stellate::core {

// The state of the boundary between rounds of refinement. Faces are meshed in stages, by dimension,
// the lowest first; an insertion that would encroach on a face of lower dimension is replaced by a
// split of that face.
template <int K>
class BoundaryState {
 public:
  // Corners nearer to each other than this, in epsilon, are one.
  static constexpr double kSameCorner = 1e-6;

  explicit BoundaryState(const BoundaryPolicy& policy, Closures closures = {})
      : policy_(policy), closures_(std::move(closures)), stage_(policy.first_stage()) {}

  const BoundaryPolicy& policy() const { return policy_; }

  // The dimension of the faces that are being meshed.
  int stage() const { return stage_; }
  bool is_last_stage() const { return stage_ == policy_.last_stage(); }
  // Goes to the next stage. Returns false after the last.
  bool Advance() { return stage_ < policy_.last_stage() && ++stage_ <= policy_.last_stage(); }
  // Faces of dimension up to this could not be refined to the end. Rules skip them from now on, so
  // that the rest of M is meshed nevertheless. 0: none.
  int left() const { return left_; }
  void Leave() { left_ = stage_; }

  // A point of M on the face of `walls` that waits for the stage of that face. `tangent`: the basis
  // there, (K rows of d), or empty.
  struct Seed {
    Eigen::VectorXd point;
    WallSet walls;
    Eigen::VectorXd tangent;
  };
  void KeepSeed(Eigen::VectorXd point, WallSet walls, Eigen::VectorXd tangent = {}) {
    seeds_.push_back({std::move(point), walls, std::move(tangent)});
  }
  std::vector<Seed>& seeds() { return seeds_; }

  // Records a point of the face of `walls` that lies beyond another wall: the face of both is near.
  void Discover(Eigen::VectorXd point, WallSet walls, int beyond) {
    if (beyond != kNoWall && closures_.Codimension(walls) < K)
      discoveries_.push_back({std::move(point), closures_.Close(walls | SetOfWall(beyond)), {}});
  }
  bool has_discoveries() const { return !discoveries_.empty(); }
  std::vector<Seed> TakeDiscoveries() { return std::exchange(discoveries_, {}); }

  // A corner, found on K walls, through which more may pass. Query the other walls' faces there to
  // know.
  struct Crowd {
    Eigen::VectorXd point, tangent, conormals;  // as of AnsweredPoints
    double size = 0;                            // as given, if sizes are
    WallSet walls = 0, possible = 0, beyond = 0;
    WallSet signs = 0;  // of the other walls
  };
  // Learns the scale of the walls' values; a value far below the largest may be zero.
  void NoteClearances(const AnsweredPoints& answers, Eigen::Index c);
  // Keeps a corner that may be crowded, and returns true if it is, or was kept before. Corners
  // within `same` are one. REQUIRES: it was found, on K walls.
  bool KeepCrowd(const AnsweredPoints& answers, Eigen::Index c, double same);
  const std::vector<Crowd>& crowds() const { return crowds_; }
  // Keeps a corner that is all of M around it: walls meet there, and another that only touches them
  // leaves nothing else inside. d coordinates each.
  void NoteLonePoint(const Eigen::VectorXd& point) {
    lone_points_.insert(lone_points_.end(), point.begin(), point.end());
  }
  const std::vector<double>& lone_points() const { return lone_points_; }
  // Keeps a corner that is all of each of these walls around it: they only touch M there.
  struct Touch {
    Eigen::VectorXd point;
    WallSet walls;
  };
  void NoteTouch(const Eigen::VectorXd& point, WallSet walls) {
    if (walls != 0) touches_.push_back({point, walls});
  }
  const std::vector<Touch>& touches() const { return touches_; }
  std::vector<Crowd> TakeCrowds() { return std::exchange(crowds_, {}); }

  // The radius of the concentric shell around a corner, on which the first points of all its edges
  // lie (Ruppert); 0: it has none.
  void SetShell(std::uint32_t corner, double radius) { shells_[corner] = radius; }
  double ShellOf(std::uint32_t point) const {
    const auto at = shells_.find(point);
    return at == shells_.end() ? 0 : at->second;
  }
  bool has_shells() const { return !shells_.empty(); }

  // A simplex of a face that an answer encroached on, to be split instead of inserting that: a
  // vertex of a star's cell, by its key. `by`: the rule that the answer was for.
  struct Split {
    std::uint32_t star;
    std::uint64_t key;
    Rule by;
    int sector;
  };
  void NoteEncroached(const Split& split) { splits_.push_back(split); }
  std::vector<Split> TakeSplits() { return std::exchange(splits_, {}); }

  // Edges are split to fit protecting balls in one round or several; then all balls are set
  // together. Returns whether further splits are allowed with so many vertices; `most`: a bound on
  // the splits, from before the first round.
  bool MaySplitForBalls(std::size_t vertices, std::size_t most) {
    if (!most_while_split_) most_while_split_ = vertices + most;
    return vertices < *most_while_split_;
  }
  void NoteProtected() { most_while_split_.reset(); }

 private:
  BoundaryPolicy policy_;
  Closures closures_;
  int stage_, left_ = 0;
  std::optional<std::size_t> most_while_split_;
  std::vector<Seed> seeds_, discoveries_;
  std::vector<Split> splits_;
  std::vector<Crowd> crowds_;
  std::vector<Eigen::VectorXd> crowded_;  // where all that were kept are
  std::vector<double> lone_points_;
  std::vector<Touch> touches_;
  Eigen::VectorXd largest_clearances_;  // by wall
  std::map<std::uint32_t, double> shells_;
};

STELLATE_DECLARE_CLASS(BoundaryState)

}  // namespace stellate::core
