#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/certificate/claims/sheet.h"
#include "core/certificate/clear_points.h"
#include "core/index/ball_tree.h"

namespace stellate::core {

// Finds points of M whose clearance from a wall, over their distance from the wall's mesh, is much
// smaller than that of points near them: a dip. There may be a second sheet near them.
//
//   ClearanceDips dips(clear, walls, wall, sheet, size);
//   for (const std::uint32_t n : dips.Find(tree, 8)) ...   // of the points new since the last call
//
// A share is clearance over distance. Most points are no dips by far, and a rough share shows it:
// shares are exact only where that decides.
class ClearanceDips {
 public:
  // Of this wall of `walls`. `clear`, `sheet`: borrowed, sheet not empty. `size`: of the mesh.
  ClearanceDips(const ClearPoints& clear, std::size_t walls, std::size_t wall, const Sheet& sheet,
                double size)
      : clear_(clear), walls_(walls), wall_(wall), sheet_(sheet), size_(size) {}

  // Returns the dips, the deepest first, at most `most` of them. `tree`: of all clear points.
  std::vector<std::uint32_t> Find(const BallTree& tree, std::size_t most);

 private:
  // A share of 0 is that of a point on the wall, or so near its mesh that the ratio has no meaning.
  struct Share {
    double least = 0;
    bool is_exact = true;
    double Most() const;
  };
  // A point that may be a dip, and the points near it.
  struct Candidate {
    std::uint32_t n;
    std::vector<std::uint32_t> near;
  };
  const double* Point(std::size_t n) const {
    return clear_.points.data() + n * static_cast<std::size_t>(sheet_.mesh.d);
  }
  Share Rough(std::size_t n, std::uint32_t some) const;
  void TakeShares(const BallTree& tree);
  Share Exact(std::size_t n) const;
  std::vector<std::uint32_t> NearestApart(const BallTree& tree, const double* q) const;
  std::vector<Candidate> Candidates(const BallTree& tree, std::size_t first) const;
  double DipAt(std::uint32_t n, const std::vector<std::uint32_t>& near) const;
  void MakeExact(const std::vector<Candidate>& candidates);

  const ClearPoints& clear_;
  std::size_t walls_, wall_;
  const Sheet& sheet_;
  double size_;
  std::vector<Share> shares_;  // by clear point
};

}  // namespace stellate::core
