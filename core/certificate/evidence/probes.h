#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/certificate/complex/topology.h"
#include "core/certificate/measure/shape.h"
#include "core/certificate/mesh_view.h"
#include "core/specification.h"

namespace stellate::core {

// Where the certifier queries M. These numbers bound the queries of a certificate: about 3500, and
// for a large mesh one probe per kVerticesAProbe vertices, a fiftieth of the queries that the mesh
// took. Nothing is queried whose answer is known. The checks that need no oracle look at the whole
// mesh.
//
// Simplices off M, and undeclared holes that they span. A narrow hole is seen by one barycentre
// alone, or by chance: none is left out while there are few.
inline constexpr std::uint32_t kMaxBarycentres = 2000;     // random ones, or all when no more
inline constexpr std::uint32_t kExtremeBarycentres = 100;  // of largest diameter; of largest tilt
// Vertices off M, and the oracle's own error, the largest that is seen: one in so many, within
// limits.
inline constexpr std::uint32_t kVertexStride = 4, kMinVertexProbes = 32, kMaxVertexProbes = 256;
// Parts of M that the mesh misses or doubles: points near the mesh; its box; the client's box.
inline constexpr std::uint64_t kProbesOfAKind = 80;
inline constexpr std::uint64_t kVerticesAProbe = 50;  // of these kinds in turn
// Sheets and curvature: the largest balls at vertices that hold none.
inline constexpr int kBallCount = 64;
inline constexpr int kMaxBallSteps = 2;
inline constexpr std::uint64_t kVerticesBesideBall = 1 << 12;  // that such a ball is compared with
// Balls of this radius, in mesh sizes, on either side of every eighth vertex, up to kMaxBallPairs;
// of all vertices in a thorough audit. A sheet that such a ball meets is nearer than twice the
// reach that the mesh size needs.
inline constexpr double kPairRadius = 2.5;
inline constexpr std::uint64_t kBallStride = 8;
inline constexpr std::uint64_t kMaxBallPairs = 256;
// Vertices compared with the tangent spaces of those near them.
inline constexpr std::uint64_t kMaxVerticesCompared = 256;

// The smallest box that holds the mesh's vertices.
struct MeshBox {
  Eigen::VectorXd lower, upper;
};
MeshBox BoxOf(const MeshView& mesh);

// Simplices whose barycentres are checked, ascending.
std::vector<std::uint32_t> ChooseSimplices(const SimplexList& list, const MeshShape& shape,
                                           std::uint64_t random_seed);
// Vertices that must be their own closest points, ascending.
std::vector<std::uint32_t> ChooseVertices(std::uint32_t vertices, std::uint64_t random_seed);

// Returns `each` points of each chosen simplex: its barycentre and, if `each` is k + 2, the points
// halfway to its corners.
Eigen::MatrixXd PointsInside(const MeshView& mesh, const SimplexList& list,
                             const std::vector<std::uint32_t>& chosen, int each);

// Returns points whose closest points on M the mesh must cover: points of simplices pushed up to
// `push` in random ambient directions, random points of the mesh's own box and of the client's; at
// least one for kVerticesAProbe vertices. Points of the client's box with which the run began are
// known already, and count.
Eigen::MatrixXd CoverageProbes(const Specification& spec, const MeshView& mesh,
                               const SimplexList& list, double push);

}  // namespace stellate::core
