#pragma once

#include <vector>

#include "core/complex/star_complex.h"
#include "core/refinement/size_field.h"

namespace stellate::core {

// Sharp edges, k = 3: what refines one of the walls encroaches on the other and back, without end,
// at angles below some 50 degrees. So their points, and the corners where they end, are guarded by
// balls as of Cheng, Dey and Ramos: nothing is inserted in a ball, and where those of neighbours
// overlap nothing outside comes nearer to the edge than they are.
//
// The radii follow the distances: less than to the neighbours along the edge, a third of that to
// any other edge or corner. Where such balls do not overlap, the edge has to be split first. Balls
// that there are keep their radii: what was inserted since lies just outside of them.
template <int K>
struct Guards {
  std::vector<double> radii2;  // squared, by point, 0 where none is needed
  // The dual vertices of edges that are too long for their balls, and not between two old ones.
  std::vector<typename StarComplex<K>::CellVertex> gaps;
  // What the splits of gaps are bounded by: see MostSplits.
  std::size_t edges = 0;  // between points that are guarded
  double longest = 0;     // of them, length
  double least_room = 0;  // the least that a ball would have if its edge's other points were away
};

// REQUIRES: LacksGuards, and that no rule applies to edges and corners.
template <int K>
Guards<K> PlanGuards(const StarComplex<K>& complex, const SizeField<K>& sizes);

// The law of the two shares. A ball is at most a = kGuardShare of the shorter of the edges at its
// point, and an edge is split while the balls at its ends are less than o = kGuardOverlap of it. An
// edge that was split has its other half beside it, as long as itself, so it is split once more if
// and only if its other neighbour is shorter by a ratio x < t = o / a - 1; and then that neighbour
// sees one that is longer by 1 / (2 x). If both x and 1 / (2 x) are below t, each has the other
// split without end: there is such an x if and only if t > 1 / sqrt 2. So splits end for all
// lengths if and only if o / a <= 1 + 1 / sqrt 2. With t < 1 / 2, moreover, both halves are longer
// than the neighbour that they were made for: no edge becomes shorter than the shortest at the
// beginning, or than the balls that what is around an edge leaves room for.
//
// a < 1: a ball must not hold its neighbours. o > 1: with the least there is a neck a quarter of
// the edge wide between two balls.
inline constexpr double kGuardShare = 0.95;
inline constexpr double kGuardOverlap = 1.25;
static_assert(kGuardOverlap / kGuardShare <= 1.5, "splits have to end");

// How many splits of gaps there are at most, if the law holds as it does on straight edges: lengths
// that grow by a ratio of 1 / t from the shortest on, at both sides of it, and that are 0.8 of a
// room that grows by a third of the way, are fewer than 20 in each octave between the shortest and
// the longest. Beyond that the rest is guarded as it is.
template <int K>
std::size_t MostSplits(const Guards<K>& guards);

// Whether walls meet too sharply to do without at some point that has no guard.
template <int K>
bool LacksGuards(const StarComplex<K>& complex);

}  // namespace stellate::core
