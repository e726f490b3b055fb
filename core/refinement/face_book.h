#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/refinement/candidate_set.h"
#include "core/walls.h"

namespace stellate::core {

// What the refinement of a manifold with boundary remembers of its faces between rounds. They are
// meshed by dimension, the lowest first: an insertion that would spoil a face of lower dimension
// yields to it.
template <int K>
class FaceBook {
 public:
  // In epsilon: corners that are no farther from each other are one.
  static constexpr double kSameCorner = 1e-6;

  explicit FaceBook(int walls) : has_walls_(walls > 0), stage_(walls > 0 ? 0 : K) {}

  bool has_walls() const { return has_walls_; }

  // Faces of dimension up to this are being meshed. Without walls there is one stage, K.
  int stage() const { return stage_; }
  // On to the next. False after the last.
  bool Advance() { return stage_ < K && ++stage_ <= K; }
  // Faces of dimension up to this were refined without end, and are left as they are: no rule looks
  // at them any more, so that the rest of M is meshed all the same. 0: none.
  int left() const { return left_; }
  void Leave() { left_ = stage_; }

  // Points of M, each on the face of `walls`, that wait for the stage of their face. `tangent`:
  // the basis there, (K rows of d), or empty.
  struct Seed {
    Eigen::VectorXd point;
    WallSet walls;
    Eigen::VectorXd tangent;
  };
  void KeepSeed(Eigen::VectorXd point, WallSet walls, Eigen::VectorXd tangent = {}) {
    seeds_.push_back({std::move(point), walls, std::move(tangent)});
  }
  std::vector<Seed>& seeds() { return seeds_; }

  // A point of the face of `walls` that lies beyond another: near it the face of both passes.
  void Discover(Eigen::VectorXd point, WallSet walls, int beyond) {
    if (CountWalls(walls) < K)
      discoveries_.push_back({std::move(point), walls | SetOfWall(beyond), {}});
  }
  bool has_discoveries() const { return !discoveries_.empty(); }
  std::vector<Seed> TakeDiscoveries() { return std::exchange(discoveries_, {}); }

  // A corner through which more than K walls may pass, as it was found on K of them: what else
  // there is to know of its others has to be asked for.
  struct Crowd {
    Eigen::VectorXd point, tangent, conormals;  // as of AnsweredPoints
    double size = 0;                            // as given, if sizes are
    WallSet walls = 0, suspects = 0, beyond = 0;
  };
  // What clearances are like; what is far below the largest may be zero.
  void NoteClearances(const AnsweredPoints& answers, Eigen::Index c);
  // Whether this corner is such a one, and is kept or known already. One at less than `same` from
  // another is that. REQUIRES: it was found, on K walls.
  bool KeepCrowd(const AnsweredPoints& answers, Eigen::Index c, double same);
  const std::vector<Crowd>& crowds() const { return crowds_; }
  std::vector<Crowd> TakeCrowds() { return std::exchange(crowds_, {}); }

  // How far the points around a corner are that were set on its edges before anything else; 0: it
  // has none.
  void SetCollar(std::uint32_t corner, double radius) { collars_[corner] = radius; }
  double CollarOf(std::uint32_t point) const {
    const auto at = collars_.find(point);
    return at == collars_.end() ? 0 : at->second;
  }
  bool has_collars() const { return !collars_.empty(); }

  // A vertex of a star's cell, by its key, that an answer encroached on: its simplex is to be split
  // instead. `by`: what the answer was for.
  struct Split {
    std::uint32_t star;
    std::uint64_t key;
    Rule by;
  };
  void NoteEncroached(const Split& split) { splits_.push_back(split); }
  std::vector<Split> TakeSplits() { return std::exchange(splits_, {}); }

  // Edges are split for guards, in one round or several; then all are guarded at once. Whether
  // there may be splits with `vertices` there are: `most`, by what is known before the first round.
  bool MaySplitForGuards(std::size_t vertices, std::size_t most) {
    if (!most_while_split_) most_while_split_ = vertices + most;
    return vertices < *most_while_split_;
  }
  void NoteGuarded() { most_while_split_.reset(); }

 private:
  bool has_walls_;
  int stage_, left_ = 0;
  std::optional<std::size_t> most_while_split_;
  std::vector<Seed> seeds_, discoveries_;
  std::vector<Split> splits_;
  std::vector<Crowd> crowds_;
  std::vector<Eigen::VectorXd> crowded_;  // where all that were kept are
  Eigen::VectorXd largest_clearances_;    // by wall
  std::map<std::uint32_t, double> collars_;
};

STELLATE_DECLARE_CLASS(FaceBook)

}  // namespace stellate::core
