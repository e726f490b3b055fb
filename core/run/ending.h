#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "core/refinement/engine.h"
#include "core/report.h"
#include "core/run/crease_probe.h"

namespace stellate::core {

// What can be said without further questions of a mesh that did not converge: inconsistent
// simplices, circumradii, the reach that neighbours show, and, if M is smooth as far as is known, a
// warning where epsilon is too coarse for that. epsilon: as the client asked for it, length.
template <int K>
void DescribeUnfinished(const Engine<K>& engine, double epsilon, bool is_smooth,
                        Certificate* certificate);

// What it is, where, and what to do, for people.
std::string DescribeCrease(const Crease& crease);

// Where walls meet at the smallest angle; below what the refinement is sure to cope with, also in
// words: a warning of a certified mesh, else at the verdict's end.
template <int K>
void TellSharpest(const Engine<K>& engine, Certificate* certificate);

// A wall that no vertex is on, if there is one, of a mesh that made no progress: at the verdict's
// end.
template <int K>
void TellUnmetWall(const Engine<K>& engine, int walls, Certificate* certificate);

// Whether a wall bends by more than epsilon can follow, or has a piece that is smaller: such a mesh
// is not going to be certified.
template <int K>
bool HasPieceTooSmall(const Engine<K>& engine, double epsilon);

struct PieceOfWall {
  int wall = 0;
  Eigen::VectorXd point;
};

// Where a wall bends by more than epsilon can follow, or has a piece that is smaller, of a mesh
// that is not certified although nothing kept it from being finished: at the verdict's end.
// `piece`: one that the mesh had been without, if there is one.
template <int K>
void TellBend(const Engine<K>& engine, double epsilon, const std::optional<PieceOfWall>& piece,
              Certificate* certificate);

// Where walls all but meet in one point, so that corners are far nearer to each other than epsilon,
// of a mesh that is not certified: at the verdict's end.
template <int K>
void TellNearCorners(const Engine<K>& engine, double epsilon, Certificate* certificate);

// Why a corner of more walls than k cannot be meshed: `along`, those that meet along an edge there,
// if that is why.
std::string WhyTooCrowded(const Eigen::VectorXd& point, WallSet walls, WallSet along, int k);

// What still breaks a rule, for people. inconsistent: simplices that DescribeUnfinished counted.
template <int K>
std::string WhatIsLeft(const Engine<K>& engine, std::uint64_t inconsistent);

// Warns where a converged mesh is not what was asked for to the last star: sizes finer than are
// meshed, cavities that were filled.
template <int K>
void WarnOfCompromises(const Engine<K>& engine, double epsilon, Certificate* certificate);

}  // namespace stellate::core
