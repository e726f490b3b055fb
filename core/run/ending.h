#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "core/refinement/corners.h"
#include "core/refinement/engine.h"
#include "core/report.h"
#include "core/run/crease_probe.h"
#include "core/run/dimension_probe.h"

namespace stellate::core {

// Describes a mesh that did not converge, without further queries: inconsistent simplices,
// circumradii, the bound of the reach by neighbours, and, if M is smooth as far as is known, a
// warning if epsilon is too coarse for that. epsilon: the client's, length.
template <int K>
void DescribeUnfinished(const Engine<K>& engine, double epsilon, bool is_smooth,
                        Certificate* certificate);

// Says what a crease is, where, and what to do, for people.
std::string DescribeCrease(const Crease& crease);

// Says where M has other dimensions than the k that were declared, for people.
std::string DescribeOtherDimension(const OtherDimension& other, int k);

// Records where walls meet at the smallest angle. If that is below SafeAngle, also adds a sentence,
// as a warning to a certified mesh, else to the verdict: first of all, as the likely cause, if the
// run is stalled.
template <int K>
void ExplainSharpest(const Engine<K>& engine, bool is_stalled, Certificate* certificate);

// Adds an inactive wall, on which no vertex lies, to the verdict of a mesh that made no progress.
template <int K>
void ExplainInactiveWall(const Engine<K>& engine, int walls, Certificate* certificate);

// Whether a wall bends by more than epsilon can follow, or has a piece that is smaller: such a mesh
// is not going to be certified.
template <int K>
bool HasPieceTooSmall(const Engine<K>& engine, double epsilon);

struct PieceOfWall {
  int wall = 0;
  Eigen::VectorXd point;
};

// Puts a cause first in the verdict of a finished mesh that is not certified: where a wall bends
// more than epsilon can follow, or has a piece smaller than that. `piece`: one that the mesh
// lacked, if any.
template <int K>
void ExplainWallCurvature(const Engine<K>& engine, double epsilon,
                          const std::optional<PieceOfWall>& piece, Certificate* certificate);

// Puts a cause first in the verdict of a mesh that is not certified: where walls nearly meet in one
// point, so that corners are far nearer to each other than epsilon.
template <int K>
void ExplainNearCorners(const Engine<K>& engine, double epsilon, Certificate* certificate);

// Explains why a corner of more than k walls cannot be meshed. has_labels: of an arrangement.
std::string WhyTooCrowded(const CrowdedCorner& corner, int k);

// Says what still breaks a rule, for people. inconsistent: simplices that DescribeUnfinished
// counted.
template <int K>
std::string WhatIsLeft(const Engine<K>& engine, std::uint64_t inconsistent);

// Warns if a converged mesh differs from the request: sizes finer than the finest bound, and filled
// cavities.
template <int K>
void WarnOfCompromises(const Engine<K>& engine, double epsilon, Certificate* certificate);

}  // namespace stellate::core
