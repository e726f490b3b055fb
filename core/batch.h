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

// The arrays of a block. An array has a column for each query, or is missing and has none.
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

// How many numbers each query has in the array.
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

// Queries of one kind. Column j is query j. The memory order is the wire's: points are n x d and
// bases n x d x k in C order, so that conversion is a copy.
//
//   QueryBlock block;  // the points of M nearest to two points of space, and tangent bases there
//   block.points = (Eigen::MatrixXd(3, 2) << 2, 0, 0, 3, 0, 0).finished();
//   block.want.tangents = true;
struct QueryBlock {
  QueryKind kind = QueryKind::kClosestPoint;
  Eigen::MatrixXd points;  // d x n: x, or the flat's point c
  Eigen::MatrixXd bases;   // (d k) x n, kIntersectFlat only: entry i*k + a of a column is
                           // coordinate i of tangent vector a; orthonormal
  Eigen::VectorXd radii;   // n, kIntersectFlat only: look no farther than this from c
  // What the answers must carry besides the points.
  struct {
    bool tangents = false;    // tangent bases
    bool sizes = false;       // local sizes
    bool clearances = false;  // clearances, and conormals on a face
  } want;
  // For manifolds with boundary: the face to query, the points of M^ where g_i = 0 for its walls,
  // for any values of the other walls; 0: M^ itself.
  WallSet face = 0;

  Eigen::Index size() const { return points.cols(); }

  // Calls f(&QueryBlock::array) for each array. All other members are the same for all queries.
  template <typename F>
  static void ForEachField(const F& f) {
    // Names all members: a new one does not compile before it is given its place here.
    [[maybe_unused]] const auto all = [](const QueryBlock& block) {
      [[maybe_unused]] const auto& [kind, points, bases, radii, want, face] = block;
    };
    f(&QueryBlock::points);
    f(&QueryBlock::bases);
    f(&QueryBlock::radii);
  }

  // Returns the queries [first, first + count).
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

// The answers to a block, or to a contiguous part of it. Column j is the answer to query j. Answer
// a block so, of the unit sphere for instance, and check it before you pass it on:
//
//   AnswerBlock answer = AnswerBlock::Shape(spec.dimension, spec.walls, block, block.size());
//   answer.points = block.points.colwise().normalized();
//   const Status status = CheckAnswers(spec, block, 0, answer);
//
// It is no error if there is no point, as within a radius: set the query's `found` to 0.
struct AnswerBlock {
  Eigen::MatrixXd points;           // d x n; ignored where not found
  std::vector<std::uint8_t> found;  // n, 1 or 0; empty: all found
  Eigen::MatrixXd tangents;         // (d k) x n laid out as QueryBlock::bases, or empty
  Eigen::VectorXd sizes;            // n lengths, of the points; ignored where not found; or empty
  Eigen::MatrixXd clearances;       // walls x n: g_i at the points; their signs count; or empty
  // (|face| d) x n: for each wall of the face, ascending, its outward unit normal within the
  // tangent space of M^; or empty
  Eigen::MatrixXd conormals;

  Eigen::Index size() const { return points.cols(); }

  // Calls f(&AnswerBlock::array) for each array, in the order of declaration.
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

  // Returns answers of the shape that `count` queries of `block` want: all zero, all found.
  static AnswerBlock Shape(int dimension, int walls, const QueryBlock& block, Eigen::Index count);
  // Returns the answers to queries [first, first + count).
  AnswerBlock Rows(Eigen::Index first, Eigen::Index count) const;
  // Overwrites the answers from `first` on by `some`. An array that is missing in one of the two,
  // or has another shape, is not changed: arrays that no query wanted are left out, and arrays may
  // be missing if no point was found.
  void Put(Eigen::Index first, const AnswerBlock& some);
  // Whether each array either is missing, or has a column for each point and as many rows as that
  // of `shape`.
  bool Fits(const AnswerBlock& shape) const;
};

// The answers to a batch.
struct Answers {
  std::vector<AnswerBlock> blocks;  // one for each block of the batch, in its order
};

// Returns the bytes of one query of a block, or of one answer.
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

// The tolerances of CheckAnswers. A client solves equations, so its answers are right to some
// solver tolerance; each bound is far above a careful solver's error and far below what could
// change a mesh. All scale with the query, so that units do not matter.

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
// The least eigenvalue that the Gram matrix of the conormals at a point may have: walls must cross
// at some 14 degrees at least.
inline constexpr double kLeastTransversality = 0.03;
// How much two answers' sizes at one point may differ, as a share of the larger: sizes guide the
// mesh and need not be exact, but must be a function of the point.
inline constexpr double kSameSizeTolerance = 0.1;
// Added to the first two, as a share of the largest coordinate involved: what rounding alone does
// to a point far from the origin.
inline constexpr double kRoundingTolerance = 1e-13;

// Checks the counts alone: each array has the shape that `block` asks for. The message says which
// has not. Pure; any thread.
Status CheckAnswerShape(const Specification& spec, const QueryBlock& block, Eigen::Index first,
                        const AnswerBlock& answer);

// Checks the answers to queries [first, first + answer.points.cols()) of `block`, as far as one
// answer alone can be checked: counts, finite numbers, on the flat, within the radius, orthonormal
// tangents, positive sizes. The message holds the query's index in the block, the value and the
// broken rule. Pure; any thread. Cost O(n d k^2).
Status CheckAnswers(const Specification& spec, const QueryBlock& block, Eigen::Index first,
                    const AnswerBlock& answer);

// Whether two sizes may belong to one point.
inline bool AreOneSize(double a, double b) {
  return std::abs(a - b) <= kSameSizeTolerance * std::max(a, b);
}

}  // namespace stellate::core
