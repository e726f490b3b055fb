#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
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
  explicit FaceBook(int walls) : has_walls_(walls > 0), stage_(walls > 0 ? 0 : K) {}

  bool has_walls() const { return has_walls_; }

  // Faces of dimension up to this are being meshed. Without walls there is one stage, K.
  int stage() const { return stage_; }
  // On to the next. False after the last.
  bool Advance() { return stage_ < K && ++stage_ <= K; }

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

 private:
  bool has_walls_;
  int stage_;
  std::vector<Seed> seeds_, discoveries_;
  std::vector<Split> splits_;
  std::map<std::uint32_t, double> collars_;
};

}  // namespace stellate::core
