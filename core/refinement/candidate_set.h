#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/refinement/criteria.h"
#include "core/refinement/target.h"
#include "core/refinement/violation_book.h"
#include "core/wall_beyond.h"

namespace stellate::core {

// Points that shall be inserted if M has a point near each: not for a target, but because a
// rehearsal inserted them, or because they are seeds.
struct PlannedPoints {
  Eigen::MatrixXd points;      // d x n
  Eigen::MatrixXd tangents;    // (K rows of d) x n, predicted; or empty
  Eigen::VectorXd spacing;     // n, predicted distance to the nearest; or empty
  std::vector<Rule> rules;     // n, what they are for; or empty
  std::vector<WallSet> walls;  // n, the face that each shall be on; or empty: all are on M

  Eigen::Index size() const { return points.cols(); }
};

// What a round asks for: points drawn for each of its targets, and after them planned ones. A
// candidate is known by its place in that order.
template <int K>
struct CandidateSet {
  std::vector<Target<K>> targets;
  std::vector<Eigen::Index> first = {0};  // by target: its first candidate; the end, at the end
  std::vector<std::uint8_t> in_flats;     // by target: to be found in its star's normal flats
  Eigen::MatrixXd points;                 // d x n, as drawn
  PlannedPoints planned;

  Eigen::Index drawn() const { return first.back(); }
  Eigen::Index size() const { return drawn() + planned.size(); }
};

// What became of candidates, in their order.
struct AnsweredPoints {
  Eigen::MatrixXd points;              // d x n, on M; without meaning where not answered
  std::vector<std::uint8_t> answered;  // a point of M was found
  std::vector<std::uint8_t> found;     // ... and its tangents
  Eigen::MatrixXd tangents;            // (K rows of d) x n
  Eigen::VectorXd sizes;               // n, where the client gives them; or empty
  // Of manifolds with boundary, else empty:
  std::vector<WallSet> walls;  // n, the face that was asked for
  Eigen::MatrixXd clearances;  // walls x n
  Eigen::MatrixXd conormals;   // (K numbers for each wall of the face, ascending) x n, in the
                               // points' own tangent coordinates

  // The wall that a point lies beyond, of those that it is not on: by the most. None: it is in M.
  std::optional<int> Beyond(Eigen::Index c) const {
    if (clearances.rows() == 0) return std::nullopt;
    return WallBeyond(clearances.col(c).data(), static_cast<int>(clearances.rows()),
                      walls[static_cast<std::size_t>(c)]);
  }
};

// How candidates are drawn.
struct Drawing {
  bool from_flats = false;  // intersections with flats can be asked for
  std::uint64_t seed = 0;   // of the run
  std::uint64_t round = 0;
};

// One candidate for a target of R1 or R2, and criteria.candidates for one of R3 or R4: the first is
// the insertion point itself, unless that has failed before; the others lie in the picking region.
template <int K>
CandidateSet<K> DrawCandidates(const StarComplex<K>& complex, const ViolationBook<K>& book,
                               const ResolvedCriteria& criteria, const Drawing& drawing,
                               std::vector<Target<K>> targets);

}  // namespace stellate::core
