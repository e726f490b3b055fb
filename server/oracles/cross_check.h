#pragma once

#include <Eigen/Core>
#include <string>

#include "core/batch.h"
#include "core/specification.h"

namespace stellate::server {

// How far two workers' answers to one query may be apart, as a share of epsilon: errors of that
// size do the mesh no harm, and a careful solver's are far smaller. Added to it, what rounding
// does: core::kRoundingTolerance of the largest coordinate.
inline constexpr double kDisagreementTolerance = 0.01;
// Largest sine of an angle between the tangent spaces at a point that both gave.
inline constexpr double kTangentDisagreement = 0.1;
// Largest sine of an angle between the conormals of one wall at a point of it that both gave.
inline constexpr double kConormalDisagreement = 0.1;
// "Not found" contradicts an intersection no farther from c than this share of the radius.
inline constexpr double kSurelyInside = 0.5;

// One worker's answer to a query: number `at` of a block.
struct Testimony {
  std::string worker;  // as people know it
  const core::AnswerBlock* answers = nullptr;
  Eigen::Index at = 0;

  bool found() const;
};

// Who says what, and which rule that breaks, in one sentence.
std::string DescribeDisagreement(const core::QueryBlock& block, Eigen::Index query,
                                 const Testimony& a, const Testimony& b, const std::string& rule);
// How far the points of two answers may be apart that are to agree. Both were found.
double AllowedApart(const core::Specification& spec, const core::QueryBlock& block,
                    Eigen::Index query, const Testimony& a, const Testimony& b);

// Compares two answers to query `query` of `block`, both of which passed CheckAnswers. Empty: they
// agree; else who says what, and what rule that breaks, in one sentence.
//
// Closest points: a point on the medial axis has several, so their distances to the query are
// compared and not the points. Intersections: the points themselves. Tangent spaces, not their
// bases, sizes and conormals: where the points agree. "Not found" contradicts nothing but an
// intersection well inside the radius: whether a solver converges is a matter of luck in some
// places. Signs of clearances: see WallSigns.
std::string FindDisagreement(const core::Specification& spec, const core::QueryBlock& block,
                             Eigen::Index query, const Testimony& a, const Testimony& b);

}  // namespace stellate::server
