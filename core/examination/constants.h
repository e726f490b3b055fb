#pragma once

namespace stellate::core::examination {

// The tolerances and steps of the laws. "size" is the diagonal of the box around the points of M
// that were found; "near" the smaller of the estimated reach and kNearEpsilons epsilon: within it M
// looks like its tangent spaces.

// Where points of M are looked for, and at how many of them the costly laws are tried.
inline constexpr int kStarts = 400;
inline constexpr int kSome = 48;
inline constexpr double kSeedSpread = 0.3;  // without a box: so far around the seeds, as a share
                                            // of their box's diagonal
inline constexpr double kBoxSlack = 1e-9;   // of the box's diagonal: a point of M so far outside is
                                            // inside

// Two points count as the same when they are nearer than this share of the size.
inline constexpr double kSlack = 1e-6;
// Above it an answer that moves is worth a note.
inline constexpr double kNoise = 1e-9;
// So far apart, as a share of the size, may answers to one query be in different batches.
inline constexpr double kBatchSlack = 1e-9;
inline constexpr int kSingleQueries = 8;  // asked alone as well
inline constexpr int kPartQueries = 150;  // the others, in parts of so many
inline constexpr double kNearEpsilons = 4;

// The differential of the closest point map, by differences in at most kMaxDirections directions.
inline constexpr double kDifferentialStep = 1e-5;  // of the size
inline constexpr int kMaxDirections = 24;
inline constexpr double kRankShare = 0.3;  // of its largest singular value, for another to count in
                                           // the rank
inline constexpr double kLeastSingular = 0.01;  // where not even the largest reaches it the rank is
                                                // 0
inline constexpr double kWrongRanks = 0.5;      // share of samples with another rank that makes the
                                                // dimension wrong
inline constexpr double kFewWrongRanks = 0.05;  // the same, once it is known that M is smooth

inline constexpr double kToleratedDegrees = 3;     // between directions that should agree, or be at
                                                   // right angles
inline constexpr double kOrthonormalSlack = 1e-8;  // of the entries of T^t T, against the
                                                   // identity's
inline constexpr double kUsableTangents = 0.5;     // the same: above it the space that they span is
                                                   // not judged
inline constexpr double kSizeSlack = 1e-9;         // of a size, between batches

// Walls. Points of each are looked for from at least kSome samples, and from as many as kStarts on
// all; points where two meet for so many pairs.
inline constexpr int kFacePairs = 66;
inline constexpr double kFaceOffset = 0.01;  // of the size: so near a face its nearest point is no
                                             // local one
inline constexpr double kConormalSlack = 1e-6;   // of a conormal's length, and of its part off the
                                                 // tangent space
inline constexpr double kClearanceSlack = 1e-5;  // of the size: so far away a wall may be zero
inline constexpr double kFarthestMiddle = 0.75;  // of the way between two points: their middle's
                                                 // closest point, from either
inline constexpr double kLeastSteepness = 0.03;  // of a wall's median slope along M, for it to
                                                 // cross M there
inline constexpr double kLeastBlunt = 0.0013;    // of 1 + cosine, where a server takes walls
                                                 // that are nearly one inside of M
inline constexpr double kAcuteDegrees = 50;  // inside a solid, below which refinement may not end
inline constexpr double kFlatReach = 0.5;    // of the size, what the reach is taken for where
                                             // nothing bends

// Federer's quotient of two samples.
inline constexpr double kShortestWay = 1e-4;  // of the size; nearer samples say nothing
inline constexpr double kLeastHeight = 1e-8;  // of the shortest way, for a height above the tangent
                                              // space
inline constexpr double kReachStep = 0.1;  // of the smaller of reach and size: then once more, so
                                           // far along M
inline constexpr double kSafeRatio = 0.4;  // of epsilon and reach
inline constexpr double kAutoEpsilon = 4;  // epsilon "auto" is the reach divided by this
inline constexpr double kAutoLeastShare = 0.25;  // of epsilon: the next is no smaller

// Off M along a normal by these shares of "near", and back.
inline constexpr double kOffsets[] = {0.05, 0.25};
inline constexpr double kLeastOffset = 1e-3;  // of the offset, for a direction to be taken

// Halving the way between two neighbours halves the turn of the tangents, except at corners.
inline constexpr int kNeighbours = 4;
inline constexpr int kHalvings = 14;
inline constexpr double kCornerDegrees = 10;
inline constexpr double kCornerLength = 0.02;  // of the size; a longer way is not judged

// Flats through samples: random entries of at most this tilt, divided by the square root of d, are
// added to the tangent bases; offsets of the centres from M, and radii, are shares of "near".
inline constexpr double kTilts[] = {0.0, 0.3};
inline constexpr double kFlatOffset = 0.1;
inline constexpr double kFlatRadius = 0.5;
inline constexpr double kShortRadius = 0.5;  // of the distance met, for a radius in which M is not
                                             // met

// Ways between neighbours, in steps, none of them longer than this share of the whole.
inline constexpr int kPieceNeighbours = 12;
inline constexpr int kPieceSteps = 8;
inline constexpr double kLeap = 0.4;

// Speed: batches, seconds for each, the share of the best rate that makes a batch good enough, the
// rate in queries a second that is slow, and how many queries a mesh of middling size takes.
inline constexpr int kBatches[] = {1, 10, 100, 1000, 10000};
inline constexpr int kMostTimedNumbers = 1 << 22;  // coordinates of a batch
inline constexpr double kSpeedSeconds = 0.03;
inline constexpr double kGoodRate = 0.9;
inline constexpr double kSlowRate = 2000;
inline constexpr double kMeshQueries = 100000;

}  // namespace stellate::core::examination
