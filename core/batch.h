#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "core/specification.h"
#include "core/walls.h"

namespace stellate::core {

enum class QueryKind {
  kClosestPoint,   // a point of M nearest to x
  kIntersectFlat,  // the point of M nearest to c in the flat c + T^perp, within a radius
};

// One array of a block. Columns of it belong to queries, or it is missing: it then has none.
namespace columns {

template <typename Array>
Eigen::Index Count(const Array& array) {
  if constexpr (Array::ColsAtCompileTime == 1)
    return array.size();
  else
    return array.cols();
}
inline Eigen::Index Count(const std::vector<std::uint8_t>& array) {
  return static_cast<Eigen::Index>(array.size());
}

// Numbers that a query has in it.
template <typename Array>
Eigen::Index Rows(const Array& array) {
  if constexpr (Array::ColsAtCompileTime == 1)
    return 1;
  else
    return array.rows();
}
inline Eigen::Index Rows(const std::vector<std::uint8_t>&) { return 1; }

template <typename Array>
Array Some(const Array& array, Eigen::Index first, Eigen::Index count) {
  if (Count(array) == 0) return {};
  if constexpr (Array::ColsAtCompileTime == 1)
    return array.segment(first, count);
  else
    return array.middleCols(first, count);
}
inline std::vector<std::uint8_t> Some(const std::vector<std::uint8_t>& array, Eigen::Index first,
                                      Eigen::Index count) {
  if (array.empty()) return {};
  return {array.begin() + first, array.begin() + first + count};
}

template <typename Array>
void Put(const Array& some, Eigen::Index first, Array* all) {
  if constexpr (Array::ColsAtCompileTime == 1)
    all->segment(first, some.size()) = some;
  else
    all->middleCols(first, some.cols()) = some;
}
inline void Put(const std::vector<std::uint8_t>& some, Eigen::Index first,
                std::vector<std::uint8_t>* all) {
  std::copy(some.begin(), some.end(), all->begin() + first);
}

}  // namespace columns

// Queries of one kind. Column j is query j. Memory order is the wire's: points are n x d and bases
// n x d x k in C order, so conversion is a copy.
struct QueryBlock {
  QueryKind kind = QueryKind::kClosestPoint;
  Eigen::MatrixXd points;      // d x n: x, or the flat's point c
  Eigen::MatrixXd bases;       // (d k) x n, kIntersectFlat only: entry i*k + a of a column is
                               // coordinate i of tangent vector a; orthonormal
  Eigen::VectorXd radii;       // n, kIntersectFlat only: look no farther than this from c
  bool want_tangents = false;  // the answers must carry tangent bases
  bool want_sizes = false;     // ... and local sizes
  // Of manifolds with boundary: the face whose points are asked for, those of M^ where g_i = 0 for
  // its walls, whatever the other walls say. M^ itself for none.
  WallSet face = 0;
  bool want_clearances = false;  // the answers must carry clearances, and conormals on a face

  Eigen::Index size() const { return points.cols(); }

  // f(&QueryBlock::array) for each array. What is not an array is the same for all queries.
  template <typename F>
  static void ForEachField(const F& f) {
    // Names all members: a new one does not compile before it is given its place here.
    [[maybe_unused]] const auto all = [](const QueryBlock& block) {
      [[maybe_unused]] const auto& [kind, points, bases, radii, tangents, sizes, face, clearances] =
          block;
    };
    f(&QueryBlock::points);
    f(&QueryBlock::bases);
    f(&QueryBlock::radii);
  }

  // Queries [first, first + count), asked in the same way.
  QueryBlock Rows(Eigen::Index first, Eigen::Index count) const;
};

// The queries of one round: all independent, all to be answered together.
struct QueryBatch {
  std::uint64_t round = 0;  // 1, 2, ...: one round trip each
  std::vector<QueryBlock> blocks;

  Eigen::Index size() const {
    Eigen::Index n = 0;
    for (const QueryBlock& b : blocks) n += b.size();
    return n;
  }
};

struct AnswerBlock {
  Eigen::MatrixXd points;           // d x n; ignored where not found
  std::vector<std::uint8_t> found;  // n, 1 or 0; empty: all found
  Eigen::MatrixXd tangents;         // (d k) x n laid out as QueryBlock::bases, or empty
  Eigen::VectorXd sizes;            // n lengths, of the points; ignored where not found; or empty
  Eigen::MatrixXd clearances;  // walls x n: g_i at the points; what counts is the sign; or empty
  // (|face| d) x n: for each wall of the face, ascending, its outward unit normal within the
  // tangent space of M^; or empty
  Eigen::MatrixXd conormals;

  Eigen::Index size() const { return points.cols(); }

  // f(&AnswerBlock::array) for each array, in the order of declaration.
  template <typename F>
  static void ForEachField(const F& f) {
    // Names all members: a new one does not compile before it is given its place here.
    [[maybe_unused]] const auto all = [](const AnswerBlock& block) {
      [[maybe_unused]] const auto& [points, found, tangents, sizes, clearances, conormals] = block;
    };
    f(&AnswerBlock::points);
    f(&AnswerBlock::found);
    f(&AnswerBlock::tangents);
    f(&AnswerBlock::sizes);
    f(&AnswerBlock::clearances);
    f(&AnswerBlock::conormals);
  }

  // To `count` queries asked as those of `block` are: all that these want, zero and found.
  static AnswerBlock Shape(int dimension, int walls, const QueryBlock& block, Eigen::Index count);
  // The answers to queries [first, first + count).
  AnswerBlock Rows(Eigen::Index first, Eigen::Index count) const;
  // Overwrites those from `first` on by `some`. An array that is missing in either, or is of
  // another shape, stays as it is: what is more than was asked for is left out, and what is missing
  // where nothing was found is not missed.
  void Put(Eigen::Index first, const AnswerBlock& some);
  // No array but has a column for each point, and as many rows as that of `shape`, or is missing.
  bool Fits(const AnswerBlock& shape) const;
};

struct Answers {
  std::vector<AnswerBlock> blocks;  // one for each block of the batch, in its order
};

// Of one query of a block, or of one answer.
template <typename Block>
std::size_t BytesPerQuery(const Block& block) {
  std::size_t bytes = 0;
  Block::ForEachField([&](auto field) {
    using Array = std::remove_cvref_t<decltype(block.*field)>;
    if (columns::Count(block.*field) > 0)
      bytes += sizeof(typename Array::value_type) *
               static_cast<std::size_t>(columns::Rows(block.*field));
  });
  return bytes;
}

// What CheckAnswers forgives. A client solves equations, so its answers are right to some solver
// tolerance and no better; each bound is far above a careful solver's error and far below what
// could change a mesh. All scale with the query, so that units do not matter.

// How far an intersection y may lie off its flat, |T^t (y - c)|, as a share of the radius asked.
inline constexpr double kFlatTolerance = 1e-6;
// How far beyond the radius it may lie, as a share of the radius: a client may stop its search at
// the radius and polish the point afterwards.
inline constexpr double kRadiusTolerance = 1e-6;
// Largest |T^t T - I| entry. Admits bases computed in single precision. The mesher itself
// tolerates directions wrong by 0.03, so this asks for orthonormality, not for accuracy.
inline constexpr double kOrthonormalTolerance = 1e-6;
// How far a conormal may be from a unit tangent vector: directions wrong by 0.2 do no harm.
inline constexpr double kConormalTolerance = 1e-3;
// Least eigenvalue of the Gram matrix of the conormals that meet in a point: walls that cross at
// less than some 14 degrees.
inline constexpr double kLeastTransversality = 0.03;
// How much two answers' sizes at one point may differ, as a share of the larger: sizes guide the
// mesh and need not be exact, but must be a function of the point.
inline constexpr double kSameSizeTolerance = 0.1;
// Added to the first two, as a share of the largest coordinate involved: what rounding alone does
// to a point far from the origin.
inline constexpr double kRoundingTolerance = 1e-13;

// Checks the answers to queries [first, first + answer.points.cols()) of `block` against what can
// be checked without asking again: counts, finiteness, on the flat, within the radius, orthonormal
// tangents, positive sizes. The message holds the query's index in the block, the value and the
// rule broken. Pure; any thread. Cost O(n d k^2).
Status CheckAnswers(const Specification& spec, const QueryBlock& block, Eigen::Index first,
                    const AnswerBlock& answer);

// Whether two sizes may be of one point.
inline bool AreOneSize(double a, double b) {
  return std::abs(a - b) <= kSameSizeTolerance * std::max(a, b);
}

}  // namespace stellate::core
