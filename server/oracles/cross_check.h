#pragma once

#include <Eigen/Core>
#include <string>

#include "core/batch.h"
#include "core/specification.h"

namespace stellate::server {

// Largest distance between two workers' answers to one query, as a share of epsilon. Errors of that
// size do not harm the mesh, and a careful solver's are far smaller. Rounding is added to it:
// core::kRoundingTolerance of the largest coordinate.
inline constexpr double kDisagreementTolerance = 0.01;
// Largest sine of the angle between two workers' tangent spaces at one point.
inline constexpr double kTangentDisagreement = 0.1;
// Largest sine of the angle between two workers' conormals of one wall at one point.
inline constexpr double kConormalDisagreement = 0.1;
// "Not found" contradicts an intersection no farther from c than this share of the radius.
inline constexpr double kSurelyInside = 0.5;

// Refers to one worker's answer to one query: number `at` of a block.
struct AnswerRef {
  std::string worker;  // its name in messages
  const core::AnswerBlock* answers = nullptr;
  Eigen::Index at = 0;

  bool found() const;
};

// Returns one sentence: which worker answered what, and the rule that the two break.
std::string DescribeDisagreement(const core::QueryBlock& block, Eigen::Index query,
                                 const AnswerRef& a, const AnswerRef& b, const std::string& rule);
// Returns the largest distance at which the points of two answers agree. REQUIRES: both were found.
double AllowedApart(const core::Specification& spec, const core::QueryBlock& block,
                    Eigen::Index query, const AnswerRef& a, const AnswerRef& b);

// Compares two answers to query `query` of `block`. Returns "" if they agree, else a sentence as of
// DescribeDisagreement. REQUIRES: both passed CheckAnswers.
//
// Closest points are compared by their distances to the query, since a point on the medial axis has
// several; intersections by the points themselves. Tangent spaces (not their bases), sizes and
// conormals are compared where the points agree. "Not found" contradicts only an intersection well
// inside the radius, since solvers fail to converge in some places. WallSigns compares the signs of
// clearances.
std::string FindDisagreement(const core::Specification& spec, const core::QueryBlock& block,
                             Eigen::Index query, const AnswerRef& a, const AnswerRef& b);

}  // namespace stellate::server
