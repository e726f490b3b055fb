#pragma once

#include <vector>

#include "core/complex/stars.h"
#include "core/refinement/size_field.h"

namespace stellate::core {

// The largest radius of a protecting ball, as a share of the size bound. A simplex at a point with
// a ball is measured beyond that ball.
inline constexpr double kLargestBall = 0.6;

// Protecting balls of sharp edges, k = 3 (Cheng, Dey and Ramos). If two walls meet at less than
// about 58 degrees, refining one encroaches on the other and back, without end. Therefore each
// vertex of such an edge, and each corner at its ends, gets a ball in which no point is inserted.
// Where the balls of neighbours overlap, no point outside is nearer to the edge than they are.
//
// A radius is less than the distance to the neighbours along the edge, and a third of the distance
// to any other edge or corner. Where such balls do not overlap, split the edge first. Existing
// balls keep their radii, since points have been inserted just outside of them.
template <int K>
struct ProtectingBalls {
  std::vector<double> radii2;  // squared, by point; 0: no ball
  // The dual vertices of edges that are too long for their balls, except between two existing ones.
  std::vector<typename Stars<K>::CellVertex> gaps;
  // For MostSplits, which bounds the splits of gaps.
  std::size_t edges = 0;       // between points with balls
  double longest = 0;          // of them, length
  double least_clearance = 0;  // the least radius without regard to the edge's other points
};

// Plans the balls. REQUIRES: NeedsProtection, and that no rule applies to edges and corners.
template <int K>
ProtectingBalls<K> PlanProtectingBalls(const Stars<K>& stars, const SizeField<K>& sizes);

// The law of the two shares. A ball is at most a = kBallShare of the shorter of the edges at its
// point, and an edge is split while the balls at its ends are less than o = kBallOverlap of it. An
// half of a split edge has the other half next to it, of the same length, so it is split once more
// if and only if its other neighbour is shorter by a ratio x < t = o / a - 1; and then that
// neighbour sees one that is longer by 1 / (2 x). If both x and 1 / (2 x) are below t, each has the
// other split without end: there is such an x if and only if t > 1 / sqrt 2. So splits end for all
// lengths if and only if o / a <= 1 + 1 / sqrt 2. With t < 1 / 2, moreover, both halves are longer
// than the neighbour that they were made for: no edge becomes shorter than the shortest at the
// beginning, or than the largest balls that keep clear of what is around the edge.
//
// a < 1: a ball must not hold its neighbours. o > 1: with the least there is a neck a quarter of
// the edge wide between two balls.
inline constexpr double kBallShare = 0.95;
inline constexpr double kBallOverlap = 1.25;
static_assert(kBallOverlap / kBallShare <= 1.5, "splits have to end");

// Bounds the splits of gaps, if the law holds as it does on straight edges. Lengths grow by a ratio
// of 1 / t from the shortest on, at both sides of it; where they are 0.8 of a clearance that grows
// by a third of the way, there are fewer than 20 in each octave between the shortest and the
// longest. Beyond the bound the rest gets balls without further splits.
template <int K>
std::size_t MostSplits(const ProtectingBalls<K>& balls);

// Whether walls meet too sharply at some point that has no ball.
template <int K>
bool NeedsProtection(const Stars<K>& stars);

}  // namespace stellate::core
