#include "core/orientation.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "core/base/arenas.h"
#include "core/certificate/complex/topology.h"
#include "tests/core/certificate/handmade_meshes.h"

namespace stellate::core {
namespace {

using Row = std::vector<std::uint32_t>;

// As meshes are sent: other ids, rows in lexicographic order.
HandmadeMesh Renumbered(const HandmadeMesh& mesh, unsigned seed) {
  std::vector<std::uint32_t> ids(mesh.vertices());
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) ids[v] = v;
  std::mt19937 random(seed);
  for (std::size_t i = ids.size(); i > 1; --i) std::swap(ids[i - 1], ids[random() % i]);
  const auto width = static_cast<std::size_t>(mesh.k) + 1;
  std::set<Row> rows;
  for (std::size_t i = 0; i < mesh.simplices.size(); i += width) {
    Row row;
    for (std::size_t j = 0; j < width; ++j) row.push_back(ids[mesh.simplices[i + j]]);
    std::sort(row.begin(), row.end());
    rows.insert(row);
  }
  HandmadeMesh other = mesh;
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v)
    std::copy_n(mesh.points.data() + std::size_t{v} * mesh.d, mesh.d,
                other.points.data() + std::size_t{ids[v]} * mesh.d);
  other.simplices.clear();
  for (const Row& row : rows) other.simplices.insert(other.simplices.end(), row.begin(), row.end());
  return other;
}

Orientation OrientationOf(const HandmadeMesh& mesh) {
  return Orient(mesh.k, mesh.d, mesh.vertices(), mesh.simplices,
                [&](std::uint32_t v) { return mesh.points.data() + std::size_t{v} * mesh.d; });
}

// The rows with the turned ones turned.
std::vector<Row> Turned(const HandmadeMesh& mesh, const Orientation& orientation) {
  std::vector<Row> rows;
  for (std::uint32_t s = 0; s < mesh.size(); ++s) {
    Row row(mesh.List()[s], mesh.List()[s] + mesh.k + 1);
    if ((orientation.turned[s / 8] >> (s % 8) & 1) != 0) std::swap(row[mesh.k - 1], row[mesh.k]);
    rows.push_back(row);
  }
  return rows;
}

// The sign of a permutation, and the row sorted.
int Sort(Row* row) {
  int sign = 1;
  for (std::size_t i = 0; i < row->size(); ++i)
    for (std::size_t j = i + 1; j < row->size(); ++j)
      if ((*row)[j] < (*row)[i]) sign = -sign;
  std::sort(row->begin(), row->end());
  return sign;
}

// The sum of the signs with which simplices induce a facet is 0 inside, 1 or -1 at the end.
void ExpectAgreement(const std::vector<Row>& rows, bool closed) {
  std::map<Row, std::vector<int>> facets;
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      Row facet = row;
      facet.erase(facet.begin() + static_cast<std::ptrdiff_t>(i));
      const int sign = Sort(&facet) * (i % 2 == 0 ? 1 : -1);
      facets[facet].push_back(sign);
    }
  }
  for (const auto& [facet, signs] : facets) {
    if (signs.size() == 1) {
      EXPECT_FALSE(closed);
    } else {
      ASSERT_EQ(signs.size(), 2u);
      EXPECT_EQ(signs[0] + signs[1], 0) << facet[0];
    }
  }
}

double VolumeOf(const HandmadeMesh& mesh, const std::vector<Row>& rows) {
  double sum = 0;
  for (const Row& row : rows) {
    Eigen::MatrixXd corners(mesh.d, mesh.d);
    for (int i = 0; i < mesh.d; ++i)
      corners.col(i) = Eigen::Map<const Eigen::VectorXd>(
          mesh.points.data() + std::size_t{row[static_cast<std::size_t>(i)]} * mesh.d, mesh.d);
    sum += corners.determinant();
  }
  return sum;
}

TEST(Orientation, NeighboursAgreeInEveryDimension) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    for (const HandmadeMesh& made :
         {SimplexBoundary(1), TorusGrid(2, 6, CliffordPoint), TorusGrid(3, 4, CliffordPoint),
          CrossPolytope(4), CrossPolytope(5)}) {
      HandmadeMesh mesh = Renumbered(made, seed);
      Orientation orientation = OrientationOf(mesh);
      ASSERT_TRUE(orientation.orientable) << mesh.k;
      ExpectAgreement(Turned(mesh, orientation), true);
      // The first stays, where no normals say otherwise.
      if (mesh.d > mesh.k + 1) {
        EXPECT_EQ(orientation.turned[0] & 1, 0);
      }
      mesh.RemoveSimplex(1);  // what is left agrees as well
      orientation = OrientationOf(mesh);
      ASSERT_TRUE(orientation.orientable) << mesh.k;
      ExpectAgreement(Turned(mesh, orientation), false);
    }
  }
}

TEST(Orientation, IsTheCertificatesUpToTheSignOfAComponent) {
  const HandmadeMesh mesh = Renumbered(TorusGrid(3, 4, CliffordPoint), 3);
  const Connectivity connectivity = ComputeConnectivity(Adjacency(mesh.List()));
  const Orientation orientation = OrientationOf(mesh);
  for (std::uint32_t s = 0; s < mesh.size(); ++s) {
    const bool turned = (orientation.turned[s / 8] >> (s % 8) & 1) != 0;
    EXPECT_EQ(turned, connectivity.orientation[s] < 0) << s;  // both begin with the first
  }
}

TEST(Orientation, NormalsPointOutwardsInEachComponent) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    HandmadeMesh inner = Renumbered(CrossPolytope(2), seed);
    for (double& x : inner.points) x *= 0.1;
    HandmadeMesh both = Renumbered(Icosphere(1), seed + 100);
    const std::uint32_t border = both.vertices();
    both.Append(inner);  // ids above the others', so still in lexicographic order
    const Orientation orientation = OrientationOf(both);
    ASSERT_TRUE(orientation.orientable);
    std::vector<Row> outer_rows, inner_rows;
    for (const Row& row : Turned(both, orientation))
      (row[0] < border ? outer_rows : inner_rows).push_back(row);
    EXPECT_GT(VolumeOf(both, outer_rows), 0);
    EXPECT_GT(VolumeOf(both, inner_rows), 0);
  }
}

TEST(Orientation, SimplicesThatFillSpaceHavePositiveVolumes) {
  // The cone from the origin over an octahedron, with the apex as the last id, then as the first.
  const HandmadeMesh shell = CrossPolytope(2);
  HandmadeMesh solid = shell;
  solid.k = 3;
  solid.AddVertex(Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity());
  solid.simplices.clear();
  for (std::uint32_t s = 0; s < shell.size(); ++s) {
    const std::uint32_t* ids = shell.List()[s];
    solid.simplices.insert(solid.simplices.end(), {ids[0], ids[1], ids[2], 6});
  }
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const HandmadeMesh mesh = Renumbered(solid, seed);
    const Orientation orientation = OrientationOf(mesh);
    ASSERT_TRUE(orientation.orientable);
    for (const Row& row : Turned(mesh, orientation)) {
      Eigen::Matrix3d sides;
      for (int i = 0; i < 3; ++i)
        sides.col(i) =
            Eigen::Map<const Eigen::Vector3d>(mesh.points.data() + 3 * std::size_t{row[i + 1]}) -
            Eigen::Map<const Eigen::Vector3d>(mesh.points.data() + 3 * std::size_t{row[0]});
      EXPECT_GT(sides.determinant(), 0);
    }
  }
}

TEST(Orientation, SaysWhereThereIsNone) {
  const Orientation none;
  EXPECT_EQ(OrientationOf(TorusGrid(2, 7, CliffordPoint, true)), none) << "Klein's bottle";
  HandmadeMesh fan = CrossPolytope(2);
  fan.AddSimplex({0, 1, 2});
  EXPECT_EQ(OrientationOf(Renumbered(fan, 1)), none) << "three triangles at an edge";
  HandmadeMesh torn = CrossPolytope(2);
  torn.simplices.pop_back();
  EXPECT_EQ(OrientationOf(torn), none) << "no whole simplices";
  HandmadeMesh empty = CrossPolytope(2);
  empty.simplices.clear();
  EXPECT_TRUE(OrientationOf(empty).orientable);
}

TEST(Orientation, IsTheSameForAnyNumberOfThreads) {
  const HandmadeMesh mesh = Renumbered(Icosphere(4), 5);
  Interruption never;
  std::vector<Orientation> found;
  for (const int threads : {1, 2, 5})
    WithThreads(threads, never, [&] { found.push_back(OrientationOf(mesh)); });
  ASSERT_EQ(found.size(), 3u);
  EXPECT_TRUE(found[0].orientable);
  EXPECT_EQ(found[0], found[1]);
  EXPECT_EQ(found[0], found[2]);
}

}  // namespace
}  // namespace stellate::core
