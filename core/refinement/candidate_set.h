#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/label_table.h"
#include "core/refinement/criteria.h"
#include "core/refinement/target.h"
#include "core/refinement/violation_index.h"
#include "core/wall_beyond.h"

namespace stellate::core {

// Points to insert, without a target, if M has a point near each: a speculative run inserted them,
// or they are seeds.
struct PlannedPoints {
  Eigen::MatrixXd points;      // d x n
  Eigen::MatrixXd tangents;    // (K rows of d) x n, predicted; or empty
  Eigen::MatrixXd bends;       // d x n, predicted: from the points to M; or empty
  Eigen::VectorXd spacing;     // n, predicted distance to the nearest; or empty
  std::vector<Rule> rules;     // n, the rule that asks for each; or empty
  std::vector<WallSet> walls;  // n, the face to find each on; or empty: all on M

  Eigen::Index size() const { return points.cols(); }
};

// The points to query in a round: those drawn for each of its targets, then the planned ones. A
// candidate's number is its place in that order.
template <int K>
struct CandidateSet {
  std::vector<Target<K>> targets;
  std::vector<Eigen::Index> first = {0};  // by target: its first candidate; the end, at the end
  std::vector<std::uint8_t> in_flats;     // by target: query the intersection with a normal flat
  Eigen::MatrixXd points;                 // d x n, as drawn
  PlannedPoints planned;

  Eigen::Index drawn() const { return first.back(); }
  Eigen::Index size() const { return drawn() + planned.size(); }
};

// The answers to a CandidateSet, in its order.
struct AnsweredPoints {
  Eigen::MatrixXd points;              // d x n, on M; undefined where not answered
  std::vector<std::uint8_t> answered;  // a point of M was found
  std::vector<std::uint8_t> found;     // ... and its tangents
  Eigen::MatrixXd tangents;            // (K rows of d) x n
  Eigen::VectorXd sizes;               // n, where the client gives them; or empty
  // Of manifolds with boundary, else empty:
  std::vector<WallSet> walls;  // n, the face that was asked for
  Eigen::MatrixXd clearances;  // walls x n
  Eigen::MatrixXd conormals;   // (K numbers for each wall of the face, ascending) x n, in the
                               // points' own tangent coordinates

  // Of arrangements, else empty: the labels, and the signs of all walls at each point (n).
  LabelTable labels;
  std::vector<WallSet> signs;

  // The face that answer c was asked for on, and its conormals there, or null.
  WallSet WallsOf(Eigen::Index c) const {
    return walls.empty() ? 0 : walls[static_cast<std::size_t>(c)];
  }
  const double* ConormalsOf(Eigen::Index c) const {
    return walls.empty() ? nullptr : conormals.col(c).data();
  }
  WallSet SignsOf(Eigen::Index c) const {
    return signs.empty() ? 0 : signs[static_cast<std::size_t>(c)];
  }
  // The wall that answer c violates most, or nothing if the point is in M. Walls that the point
  // lies on do not count. Of arrangements: the wall beside which the live face is, or kNoWall, if
  // the point's own face is not live there.
  std::optional<int> Beyond(Eigen::Index c) const {
    if (clearances.rows() == 0) return std::nullopt;
    const WallSet face = walls[static_cast<std::size_t>(c)];
    if (labels.empty())
      return WallBeyond(clearances.col(c).data(), static_cast<int>(clearances.rows()), face);
    if (labels.Piece(face, SignsOf(c)) != 0) return std::nullopt;
    return labels.Beside(face, SignsOf(c), clearances.col(c).data()).value_or(kNoWall);
  }
  // Of arrangements: the wall that meets the point's face the nearest to it. Nothing else shows
  // such a face before the mesh comes to it: M goes on beyond.
  std::optional<int> NextWall(Eigen::Index c) const {
    if (labels.empty()) return std::nullopt;
    return labels.Nearest(walls[static_cast<std::size_t>(c)], SignsOf(c), clearances.col(c).data());
  }
  // As Beyond for the answer to a target whose simplex has these signs. Of arrangements, the point
  // must be on the same piece: else the wall between the two, or kNoWall.
  std::optional<int> BeyondFrom(Eigen::Index c, WallSet wanted) const {
    if (labels.empty() || clearances.rows() == 0) return Beyond(c);
    const WallSet face = walls[static_cast<std::size_t>(c)];
    if (labels.Piece(face, SignsOf(c)) == labels.Piece(face, wanted)) return std::nullopt;
    return labels.Between(face, SignsOf(c), wanted, clearances.col(c).data()).value_or(kNoWall);
  }
};

// How candidates are drawn.
struct Drawing {
  bool from_flats = false;  // the oracle answers intersections with flats
  std::uint64_t seed = 0;   // of the run
  std::uint64_t round = 0;
};

// Draws the candidates of a round: one for a target of R1 or R2, criteria.candidates for one of R3
// or R4. The first is the insertion point itself, unless that has failed before; the others lie in
// the picking region.
template <int K>
CandidateSet<K> DrawCandidates(const Stars<K>& stars, const ViolationIndex<K>& violations,
                               const ResolvedCriteria& criteria, const Drawing& drawing,
                               std::vector<Target<K>> targets);

}  // namespace stellate::core
