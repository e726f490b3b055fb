// Manifolds with boundary, each turned anew and with other random numbers in every trial: the mesh
// ends at its faces alone, has the right topology, and says so. The facets are counted here.
//
// $STELLATE_WALL_TRIALS: turns of each (1).

#include <gtest/gtest.h>

#include <cstdlib>
#include <map>
#include <set>
#include <string>

#include "tests/core/support/domains.h"

namespace stellate::core {
namespace {

using stellate::testing::Domain;

using Ids = std::vector<std::uint32_t>;

// The mesh, as it came in deltas.
struct Mesh {
  Report report;
  std::set<Ids> simplices;
  std::vector<WallSet> walls;
};

Mesh MeshOf(Domain& m, Specification spec) {
  auto mesher = Mesher::Create(std::move(spec));
  if (!mesher) throw std::runtime_error(mesher.error().message);
  Mesh mesh;
  const auto width = static_cast<std::size_t>(m.k) + 1;
  const auto each = [&](const Ids& all, const auto& take) {
    for (std::size_t s = 0; s < all.size(); s += width)
      take(Ids(all.begin() + static_cast<std::ptrdiff_t>(s),
               all.begin() + static_cast<std::ptrdiff_t>(s + width)));
  };
  while (const QueryBatch* batch = (*mesher)->NextBatch()) {
    const auto delta = (*mesher)->Absorb(m.AnswersOf(*batch));
    if (!delta) throw std::runtime_error(delta.error().message);
    each(delta->removed, [&](const Ids& s) { mesh.simplices.erase(s); });
    each(delta->added, [&](const Ids& s) { mesh.simplices.insert(s); });
    mesh.walls.insert(mesh.walls.end(), delta->walls.begin(), delta->walls.end());
  }
  mesh.report = (*mesher)->report();
  return mesh;
}

// Of all faces of some simplices.
int EulerCharacteristic(const std::set<Ids>& simplices) {
  std::set<Ids> all;
  for (const Ids& s : simplices)
    for (unsigned mask = 1; mask < 1u << s.size(); ++mask) {
      Ids face;
      for (std::size_t i = 0; i < s.size(); ++i)
        if (mask >> i & 1u) face.push_back(s[i]);
      all.insert(face);
    }
  int chi = 0;
  for (const Ids& face : all) chi += face.size() % 2 == 1 ? 1 : -1;
  return chi;
}

std::size_t Components(const std::set<Ids>& simplices) {
  std::map<std::uint32_t, std::uint32_t> parent;
  const auto root = [&](std::uint32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const Ids& s : simplices)
    for (const std::uint32_t v : s) {
      parent.emplace(v, v);
      parent[root(v)] = root(s[0]);
    }
  std::size_t count = 0;
  for (const auto& [v, up] : parent) count += v == up;
  return count;
}

// The facets in one simplex; none is in three.
std::set<Ids> BoundaryOf(const std::set<Ids>& simplices) {
  std::map<Ids, int> facets;
  for (const Ids& s : simplices)
    for (std::size_t i = 0; i < s.size(); ++i) {
      Ids facet = s;
      facet.erase(facet.begin() + static_cast<std::ptrdiff_t>(i));
      ++facets[facet];
    }
  std::set<Ids> boundary;
  for (const auto& [facet, count] : facets) {
    EXPECT_LE(count, 2);
    if (count == 1) boundary.insert(facet);
  }
  return boundary;
}

int Trials() {
  const char* const trials = std::getenv("STELLATE_WALL_TRIALS");
  return trials ? std::atoi(trials) : 1;
}

struct Case {
  std::string name;
  Domain (*make)();
  double epsilon;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name << " at " << c.epsilon; }

class Walls : public ::testing::TestWithParam<Case> {};

TEST_P(Walls, AreWhereTheMeshEnds) {
  for (int trial = 0; trial < Trials(); ++trial) {
    Domain m = GetParam().make().Turned(static_cast<unsigned>(trial));
    Specification spec = m.SpecificationFor(GetParam().epsilon);
    spec.random_seed = static_cast<std::uint64_t>(trial) + 1;
    const Mesh mesh = MeshOf(m, spec);
    SCOPED_TRACE("trial " + std::to_string(trial));
    EXPECT_EQ(mesh.report.termination, Termination::kConverged);
    const Certificate& c = mesh.report.certificate;
    EXPECT_TRUE(c.certified) << c.verdict;
    EXPECT_EQ(EulerCharacteristic(mesh.simplices), m.euler);
    EXPECT_EQ(c.euler_characteristic, m.euler);
    const std::set<Ids> boundary = BoundaryOf(mesh.simplices);
    EXPECT_EQ(Components(boundary), m.boundary_components);
    EXPECT_EQ(c.boundary_components, m.boundary_components);
    EXPECT_EQ(c.boundary_simplices, boundary.size());
    for (const Ids& facet : boundary) {
      WallSet common = ~WallSet{0};
      for (const std::uint32_t v : facet) common &= mesh.walls[v];
      EXPECT_NE(common, 0u) << "a rim that is on no wall";
    }
    EXPECT_TRUE(BoundaryOf(boundary).empty()) << "the boundary has none";
    if (HasFailure()) return;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Domains, Walls,
    ::testing::Values(Case{"arc", stellate::testing::Arc, 0.2},
                      Case{"hemisphere", stellate::testing::Hemisphere, 0.3},
                      Case{"half a torus", stellate::testing::HalfTorus, 0.1},
                      Case{"octant", stellate::testing::Octant, 0.2},
                      Case{"disc", stellate::testing::Disc, 0.2},
                      Case{"annulus", stellate::testing::Annulus, 0.1},
                      Case{"half a Clifford torus", stellate::testing::HalfClifford, 0.2},
                      Case{"gyroid in a box", stellate::testing::GyroidInABox, 0.15},
                      Case{"ball", stellate::testing::Ball, 0.4},
                      Case{"shell", stellate::testing::Shell, 0.2},
                      Case{"cube", stellate::testing::Cube, 0.6},
                      Case{"solid torus", stellate::testing::SolidTorus, 0.16},
                      Case{"cylinder", stellate::testing::Cylinder, 0.3},
                      Case{"half of S^3", stellate::testing::HalfSphere3, 0.35}));

}  // namespace
}  // namespace stellate::core
