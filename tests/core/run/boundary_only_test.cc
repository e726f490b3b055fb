// Boundaries meshed without their inside, judged by what closed surfaces are: homology, and the
// volume that they enclose by the divergence theorem.

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "core/mesher.h"
#include "tests/core/support/arrangements.h"
#include "tests/core/support/domains.h"
#include "tests/core/support/homology.h"

namespace stellate::core {
namespace {

using stellate::testing::Arrangement;
using stellate::testing::Complex;
using stellate::testing::Domain;
using Sides = std::pair<int, int>;  // labels: behind, ahead

// A boundary as it came in deltas.
struct Boundary {
  Report report;
  Eigen::MatrixXd points;
  std::map<std::vector<std::uint32_t>, Sides> simplices;
  std::vector<WallSet> walls;  // by vertex

  // The surface of a region.
  Complex Of(int label) const {
    Complex surface;
    for (const auto& [ids, sides] : simplices)
      if (sides.first == label || sides.second == label) surface.insert(ids);
    return surface;
  }
  // The volume that it encloses: positive, if its simplices are turned outwards.
  double VolumeOf(int label) const {
    const Eigen::Index d = points.rows();
    double sum = 0;
    for (const auto& [ids, sides] : simplices) {
      if (sides.first != label && sides.second != label) continue;
      Eigen::MatrixXd corners(d, d);
      for (Eigen::Index i = 0; i < d; ++i)
        corners.col(i) = points.col(ids[static_cast<std::size_t>(i)]);
      sum += (sides.first == label ? 1 : -1) * corners.determinant();
    }
    return sum / std::tgamma(static_cast<double>(d) + 1);
  }
};

Boundary BoundaryOf(Domain domain, Specification spec, Execution execution = {}) {
  spec.boundary_only = true;
  auto created = Mesher::Create(spec, execution);
  if (!created) throw std::runtime_error(created.error().message);
  Mesher& mesher = **created;
  Boundary mesh;
  const auto width = static_cast<std::size_t>(spec.dimension);
  const auto row = [&](const std::vector<std::uint32_t>& all, std::size_t s) {
    return std::vector<std::uint32_t>(all.begin() + static_cast<std::ptrdiff_t>(s * width),
                                      all.begin() + static_cast<std::ptrdiff_t>((s + 1) * width));
  };
  const auto sides = [](const std::vector<std::int8_t>& labels, std::size_t s) {
    return Sides(labels[2 * s], labels[2 * s + 1]);
  };
  while (const auto batch = mesher.NextBatch()) {
    const auto delta = mesher.Absorb(domain.AnswersOf(*batch));
    if (!delta) throw std::runtime_error(delta.error().message);
    for (std::size_t s = 0; s * width < delta->removed.size(); ++s)
      EXPECT_EQ(mesh.simplices.erase(row(delta->removed, s)), 1u);
    for (std::size_t s = 0; s * width < delta->added.size(); ++s)
      EXPECT_TRUE(mesh.simplices.emplace(row(delta->added, s), sides(delta->labels, s)).second);
    mesh.walls.insert(mesh.walls.end(), delta->walls.begin(), delta->walls.end());
    EXPECT_EQ(mesher.progress().simplices, mesh.simplices.size());
  }
  mesh.report = mesher.report();
  mesh.points = mesher.Points();
  // The deltas add up to the mesh.
  const std::vector<std::uint32_t> all = mesher.Simplices();
  const std::vector<std::int8_t> labels = mesher.Labels();
  EXPECT_EQ(all.size(), mesh.simplices.size() * width);
  for (std::size_t s = 0; s * width < all.size(); ++s)
    EXPECT_EQ(mesh.simplices.at(row(all, s)), sides(labels, s));
  return mesh;
}

// What is known of the surface of a region.
struct Known {
  double volume = 0;
  std::vector<int> homology;  // of its surface
  double radius = 1;          // of what bends most
};

struct Case {
  std::string name;
  Domain domain;
  double epsilon = 0.3;
  std::map<int, Known> regions;
  std::function<int(WallSet)> label = nullptr;

  Specification SpecificationFor(const Domain& turned) const {
    Specification spec = turned.SpecificationFor(epsilon);
    for (WallSet signs = 0; label && signs < SetOfWall(spec.walls); ++signs)
      spec.labels.push_back(static_cast<std::int8_t>(label(signs)));
    return spec;
  }
};

double BallVolume(double radius) { return 4 * std::numbers::pi / 3 * std::pow(radius, 3); }

std::vector<Case> Cases() {
  const double pi = std::numbers::pi;
  std::vector<Case> all;
  all.push_back({"Ball", stellate::testing::Ball(), 0.25, {{1, {BallVolume(1), {1, 0, 1}}}}});
  all.push_back({"Cube", stellate::testing::Cube(), 0.5, {{1, {8, {1, 0, 1}}}}});
  all.push_back({"Disc", stellate::testing::Disc(), 0.1, {{1, {pi, {1, 1}}}}});
  all.push_back({"Annulus", stellate::testing::Annulus(), 0.1, {{1, {0, {2, 2}}}}});
  all.push_back({"Ball4", stellate::testing::Ball4(), 0.5, {{1, {pi * pi / 2, {1, 0, 0, 1}}}}});
  {
    // The lens of two unit balls: two caps of the height 1 - cos(25 degrees).
    const double h = 1 - std::cos(25 * pi / 180);
    all.push_back({"Lens50",
                   stellate::testing::Lens(50),
                   0.1,
                   {{1, {2 * pi * h * h * (3 - h) / 3, {1, 0, 1}, 0.33}}}});
  }
  all.push_back({"SolidTorus", stellate::testing::SolidTorus(), 0.12, {{1, {0, {1, 2, 1}}}}});
  all.push_back({"Octahedron", stellate::testing::Octahedron(), 0.3, {{1, {4.0 / 3, {1, 0, 1}}}}});
  const auto add = [&](const Arrangement& a, std::string name, std::map<int, Known> regions) {
    all.push_back({std::move(name), a.domain, a.epsilon, std::move(regions), a.label});
  };
  const std::vector<Arrangement> space = stellate::testing::SpaceArrangements();
  // Two unit balls, their centres 1 apart, have caps of the height 1/2 in common, twice.
  const double common = 2 * pi * 0.25 * 2.5 / 3;
  add(space[0], "Union", {{1, {2 * BallVolume(1) - common, {1, 0, 1}}}});
  add(space[5], "Venn",
      {{1, {BallVolume(1) - common, {1, 0, 1}}},
       {2, {BallVolume(1) - common, {1, 0, 1}}},
       {3, {common, {1, 0, 1}}}});
  add(space[8], "BallInCube",
      {{1, {8 - BallVolume(0.6), {2, 0, 2}}}, {2, {BallVolume(0.6), {1, 0, 1}, 0.6}}});
  {
    Arrangement hole = space[8];
    hole.label = [](WallSet s) {
      return stellate::testing::AllOf(s, 0, 6) && !stellate::testing::AllOf(s, 6, 7) ? 1 : 0;
    };
    add(hole, "CubeMinusBall", {{1, {8 - BallVolume(0.6), {2, 0, 2}}}});
  }
  {
    Arrangement shells = space[8];
    shells.domain.walls = {stellate::testing::InBall(Eigen::Vector3d::Zero(), 1),
                           stellate::testing::InBall(Eigen::Vector3d(0.1, 0.05, -0.1), 0.6)};
    shells.label = [](WallSet s) { return s == 3 ? 2 : s == 1 ? 1 : 0; };
    shells.epsilon = 0.15;
    add(shells, "BallInBall",
        {{1, {BallVolume(1) - BallVolume(0.6), {2, 0, 2}}},
         {2, {BallVolume(0.6), {1, 0, 1}, 0.6}}});
  }
  const std::vector<Arrangement> plane = stellate::testing::PlaneArrangements();
  add(plane[2], "Venn2", {{1, {0, {1, 1}}}, {2, {0, {1, 1}}}, {3, {0, {1, 1}}}});
  add(plane[4], "TJunctions", {{1, {0, {1, 1}}}, {2, {0, {1, 1}}}, {3, {0, {1, 1}}}});
  add(plane[5], "LShape", {{1, {4 - 0.9 * 0.8, {1, 1}}}});
  return all;
}

class BoundaryOnlyTest : public ::testing::TestWithParam<std::tuple<Case, unsigned>> {};

TEST_P(BoundaryOnlyTest, IsClosedAndFacesOutwards) {
  const auto& [known, seed] = GetParam();
  const Domain domain = known.domain.Turned(seed);
  Specification spec = known.SpecificationFor(domain);
  spec.bounding_box = BoundingBox{domain.box.lower, domain.box.upper};
  spec.random_seed = seed + 1;
  const Boundary mesh = BoundaryOf(domain, spec);
  const Certificate& certificate = mesh.report.certificate;
  EXPECT_TRUE(certificate.certified) << certificate.verdict;
  EXPECT_EQ(mesh.report.counts.simplices, mesh.simplices.size());
  for (const auto& [label, region] : known.regions) {
    const Complex surface = mesh.Of(label);
    EXPECT_TRUE(stellate::testing::RimOf(surface).empty()) << label;
    EXPECT_EQ(stellate::testing::BettiNumbers(surface), region.homology) << label;
    const double volume = mesh.VolumeOf(label);
    EXPECT_GT(volume, 0) << label;
    // Chords of what bends lie about epsilon^2 / (2 radius) within.
    if (region.volume > 0) {
      const double chords = 1.5 * std::pow(spec.epsilon / region.radius, 2) * region.volume;
      EXPECT_NEAR(volume, region.volume, chords + 1e-9) << label;
    }
    if (!known.label) {
      EXPECT_NEAR(certificate.volume, volume, 1e-9 * volume);
    }
    for (const RegionReport& report : certificate.regions) {
      if (report.label != label) continue;
      EXPECT_EQ(report.simplices, surface.size());
      EXPECT_EQ(report.euler_characteristic, stellate::testing::EulerOf(surface));
      EXPECT_EQ(report.components, static_cast<std::uint64_t>(region.homology[0]));
      EXPECT_NEAR(report.volume, volume, 1e-9 * volume);
      if (domain.k <= 3) {
        const std::vector<std::int64_t> betti(region.homology.begin(), region.homology.end());
        EXPECT_EQ(report.betti, betti);
      }
    }
  }
  // Vertices are on the walls that they are said to be on, and on no others.
  for (std::size_t v = 0; v < mesh.walls.size(); ++v)
    for (std::size_t w = 0; w < domain.walls.size(); ++w) {
      const double g = domain.walls[w](mesh.points.col(static_cast<Eigen::Index>(v)), nullptr);
      EXPECT_EQ((mesh.walls[v] & SetOfWall(static_cast<int>(w))) != 0, std::abs(g) < 1e-8) << v;
    }
  // Each simplex has what the walls' signs say on either side of it.
  if (!known.label) return;
  for (const auto& [ids, sides] : mesh.simplices) {
    WallSet common = ~WallSet{0};
    for (const std::uint32_t v : ids) common &= mesh.walls[v];
    EXPECT_NE(common, 0u);
    EXPECT_NE(sides.first, sides.second);
  }
}

// Creases are kept: each edge of a cube is a chain of the mesh's own edges.
TEST(BoundaryOnly, KeepsCreases) {
  const Domain cube = stellate::testing::Cube();
  const Boundary mesh = BoundaryOf(cube, cube.SpecificationFor(0.5));
  ASSERT_TRUE(mesh.report.certificate.certified) << mesh.report.certificate.verdict;
  std::map<WallSet, double> length;
  const std::vector<Complex> faces = stellate::testing::FacesOf(mesh.Of(1));
  for (const auto& edge : faces[1]) {
    const WallSet both = mesh.walls[edge[0]] & mesh.walls[edge[1]];
    if (CountWalls(both) == 2)
      length[both] += (mesh.points.col(edge[0]) - mesh.points.col(edge[1])).norm();
  }
  EXPECT_EQ(length.size(), 12u);
  for (const auto& [walls, sum] : length) EXPECT_NEAR(sum, 2, 1e-9) << walls;
  int edges = 0, corners = 0;
  for (const FaceReport& face : mesh.report.certificate.faces) {
    edges += face.dimension == 1;
    corners += face.dimension == 0;
  }
  EXPECT_EQ(edges, 12);
  EXPECT_EQ(corners, 8);
}

// The boundary's vertices are the solid's, up to those that its inside asked for.
TEST(BoundaryOnly, HasTheVerticesOfTheSolid) {
  for (const Domain& domain : {stellate::testing::Ball(), stellate::testing::Cube()}) {
    const Specification spec = domain.SpecificationFor(0.3);
    const Boundary alone = BoundaryOf(domain, spec);
    auto whole = *Mesher::Create(spec);
    Domain m = domain;
    while (const auto batch = whole->NextBatch()) ASSERT_TRUE(whole->Absorb(m.AnswersOf(*batch)));
    std::set<std::vector<double>> of_solid;
    const auto list = [](const Eigen::VectorXd& p) {
      return std::vector<double>(p.data(), p.data() + p.size());
    };
    for (Eigen::Index v = 0; v < whole->Points().cols(); ++v)
      of_solid.insert(list(whole->Points().col(v)));
    Eigen::Index missing = 0;
    for (Eigen::Index v = 0; v < alone.points.cols(); ++v)
      missing += !of_solid.contains(list(alone.points.col(v)));
    EXPECT_EQ(missing, 0) << alone.points.cols();
    EXPECT_LT(alone.report.counts.queries, whole->report().counts.queries);
  }
}

// In codimension: circles on a sphere, a 3-sphere on half of a 4-sphere, curves on a torus.
TEST(BoundaryOnly, IsMeshedInCodimension) {
  const Domain hemisphere = stellate::testing::Hemisphere();
  const Boundary circle = BoundaryOf(hemisphere, hemisphere.SpecificationFor(0.1));
  EXPECT_TRUE(circle.report.certificate.certified) << circle.report.certificate.verdict;
  EXPECT_EQ(stellate::testing::BettiNumbers(circle.Of(1)), (std::vector<int>{1, 1}));
  const Domain half = stellate::testing::CutTorus3();
  const Boundary tori = BoundaryOf(half, half.SpecificationFor(0.4));
  EXPECT_TRUE(tori.report.certificate.certified) << tori.report.certificate.verdict;
  EXPECT_EQ(stellate::testing::BettiNumbers(tori.Of(1)), (std::vector<int>{2, 4, 2}));
  const Arrangement torus = stellate::testing::PlaneArrangements()[6];
  const Boundary curves = BoundaryOf(torus.domain, torus.SpecificationFor(torus.epsilon));
  EXPECT_TRUE(curves.report.certificate.certified) << curves.report.certificate.verdict;
  // Where one label has two opposite corners of four, its outline touches itself.
  for (const int label : {1, 2})
    for (const auto& facet : stellate::testing::RimOf(curves.Of(label)))
      EXPECT_EQ(CountWalls(curves.walls[facet[0]]), 2) << label;
}

// Two opposite quarters of a ball: they touch in an edge alone.
TEST(BoundaryOnly, IsTakenApartWhereARegionTouchesItself) {
  Arrangement quarters = stellate::testing::SpaceArrangements()[0];
  quarters.domain.walls = {stellate::testing::InBall(Eigen::Vector3d::Zero(), 1),
                           stellate::testing::HalfSpaceOf(Eigen::Vector3d(1, 0, 0), 0),
                           stellate::testing::HalfSpaceOf(Eigen::Vector3d(0, 1, 0), 0)};
  quarters.label = [](WallSet s) { return s == 3 || s == 5 ? 1 : 0; };
  const Domain domain = quarters.domain.Turned(1);
  Specification spec = quarters.SpecificationFor(0.25);
  spec.bounding_box = BoundingBox{domain.box.lower, domain.box.upper};
  const Boundary mesh = BoundaryOf(domain, spec);
  const Certificate& certificate = mesh.report.certificate;
  EXPECT_TRUE(certificate.certified) << certificate.verdict;
  EXPECT_NEAR(mesh.VolumeOf(1), BallVolume(1) / 2, 0.15);
  EXPECT_FALSE(stellate::testing::RimOf(mesh.Of(1)).empty());
  for (const auto& facet : stellate::testing::RimOf(mesh.Of(1)))
    for (const std::uint32_t v : facet) EXPECT_EQ(mesh.walls[v] & 6, 6u);
  ASSERT_EQ(certificate.regions.size(), 1u);
  EXPECT_GT(certificate.pinched_vertices, 3u);
  ASSERT_FALSE(certificate.warnings.empty());
  EXPECT_EQ(certificate.warnings.front().rfind("Pinched at ", 0), 0u);
  EXPECT_EQ(certificate.regions[0].components, 1u);
}

// The interfaces of three phases that meet in an edge, of four that meet in a point, and of three
// on a torus: each region's surface is closed, and each simplex has the labels of the phases that
// are the largest on either side of it.
TEST(BoundaryOnly, HasTheInterfacesOfPhases) {
  std::vector<Arrangement> all = stellate::testing::PhaseArrangements();
  all.push_back(stellate::testing::PhasesInTorus());
  for (const Arrangement& phases : all) {
    for (const unsigned seed : {0u, 1u}) {
      const Domain domain = phases.domain.Turned(seed);
      Specification spec = phases.SpecificationFor(phases.epsilon);
      spec.bounding_box = BoundingBox{domain.box.lower, domain.box.upper};
      spec.random_seed = seed + 1;
      const Boundary mesh = BoundaryOf(domain, spec);
      const Certificate& certificate = mesh.report.certificate;
      EXPECT_TRUE(certificate.certified) << phases.name << seed << ": " << certificate.verdict;
      EXPECT_EQ(certificate.pinched_vertices, 0u);
      double together = 0;
      for (const auto& [label, euler] : phases.euler) {
        EXPECT_TRUE(stellate::testing::RimOf(mesh.Of(label)).empty()) << phases.name << label;
        const int sphere = domain.k == 2 ? 0 : 2;
        EXPECT_EQ(stellate::testing::EulerOf(mesh.Of(label)), euler * sphere) << phases.name;
        EXPECT_GT(mesh.VolumeOf(label), 0) << phases.name << label;
        together += mesh.VolumeOf(label);
      }
      EXPECT_NEAR(certificate.volume, together, 1e-9 * together) << phases.name;
      std::set<Sides> pairs;
      for (const auto& [ids, sides] : mesh.simplices) {
        pairs.insert(std::minmax(sides.first, sides.second));
        WallSet on = ~WallSet{0};
        Eigen::VectorXd middle = Eigen::VectorXd::Zero(domain.d);
        for (const std::uint32_t v : ids) {
          on &= mesh.walls[v];
          middle += mesh.points.col(v) / static_cast<double>(ids.size());
        }
        // Of the walls that the simplex is on, one separates its labels.
        WallSet signs = 0;
        for (std::size_t w = 0; w < domain.walls.size(); ++w)
          if (domain.walls[w](middle, nullptr) >= 0) signs |= SetOfWall(static_cast<int>(w));
        bool separates = false;
        ForEachWall(on, [&](int wall) {
          const Sides of(phases.label(signs & ~SetOfWall(wall)),
                         phases.label(signs | SetOfWall(wall)));
          separates = separates ||
                      std::minmax(of.first, of.second) == std::minmax(sides.first, sides.second);
        });
        if (CountWalls(on) == 1) {
          EXPECT_TRUE(separates) << phases.name;
        }
      }
      const std::size_t n = phases.euler.size();  // each two of them meet, and each ends outside
      EXPECT_EQ(pairs.size(), n * (n - 1) / 2 + n) << phases.name;
    }
  }
}

TEST(BoundaryOnly, HasTheCurvesBetweenPhasesOnASurface) {
  const Arrangement phases = stellate::testing::PhasesOnTorus();
  const Boundary mesh = BoundaryOf(phases.domain, phases.SpecificationFor(phases.epsilon));
  EXPECT_TRUE(mesh.report.certificate.certified) << mesh.report.certificate.verdict;
  std::size_t triple = 0;
  for (const WallSet walls : mesh.walls) triple += CountWalls(walls) == 3;
  EXPECT_EQ(triple, 4u);
  for (const int label : {1, 2, 3})
    EXPECT_TRUE(stellate::testing::RimOf(mesh.Of(label)).empty()) << label;
  std::set<Sides> pairs;
  for (const auto& [ids, sides] : mesh.simplices)
    pairs.insert(std::minmax(sides.first, sides.second));
  EXPECT_EQ(pairs, (std::set<Sides>{{1, 2}, {1, 3}, {2, 3}}));
}

// The verdict sums up what it is made of; the certificate has each face.
TEST(BoundaryOnly, SumsUpInTheVerdict) {
  const Domain cube = stellate::testing::Cube();
  const Boundary mesh = BoundaryOf(cube, cube.SpecificationFor(0.6));
  const std::string& verdict = mesh.report.certificate.verdict;
  EXPECT_NE(verdict.find("6 pieces of walls, 12 edges and 8 corners"), std::string::npos)
      << verdict;
  EXPECT_EQ(verdict.find("walls 0+"), std::string::npos) << verdict;
}

// How many components M has is known of its boundary where M fills space: two balls, of which one
// has a void, and a ball around which there is a shell.
TEST(BoundaryOnly, CountsComponents) {
  Arrangement balls = stellate::testing::SpaceArrangements()[0];
  const auto ball = [](double x, double y, double z, double radius) {
    return stellate::testing::InBall(Eigen::Vector3d(x, y, z), radius);
  };
  balls.domain.walls = {ball(-1.2, 0, 0, 1), ball(-1.1, 0.05, -0.1, 0.6), ball(1.2, 0, 0, 0.7)};
  balls.domain.box = stellate::testing::CubeOf(3, 2.4);
  balls.label = [](WallSet s) { return s == 1 || s == 4 ? 1 : 0; };
  Specification spec = balls.SpecificationFor(0.18);
  spec.components = 2;
  const Boundary two = BoundaryOf(balls.domain, spec);
  EXPECT_TRUE(two.report.certificate.certified) << two.report.certificate.verdict;
  EXPECT_EQ(two.report.certificate.components, 3u) << "of the boundary";
  spec.components = 3;
  const Boundary three = BoundaryOf(balls.domain, spec);
  EXPECT_FALSE(three.report.certificate.certified);
  EXPECT_NE(three.report.certificate.verdict.find("that of 2 components where 3 were declared"),
            std::string::npos)
      << three.report.certificate.verdict;
  Arrangement shells = balls;
  shells.domain.walls = {ball(0, 0, 0, 1.5), ball(0.1, 0.05, -0.1, 1.1),
                         ball(-0.05, 0.1, 0.08, 0.6)};
  shells.label = [](WallSet s) { return s == 1 || s == 7 ? 1 : 0; };
  spec = shells.SpecificationFor(0.2);
  spec.components = 2;
  const Boundary shell = BoundaryOf(shells.domain, spec);
  EXPECT_TRUE(shell.report.certificate.certified) << shell.report.certificate.verdict;
  spec.components = 3;
  EXPECT_FALSE(BoundaryOf(shells.domain, spec).report.certificate.certified);
}

// A void that no seed is near is found from beside the boundary, or the mesh refused.
TEST(BoundaryOnly, DoesNotMissAVoid) {
  Domain shell = stellate::testing::Ball();
  shell.walls.push_back(stellate::testing::BallOf(Eigen::Vector3d(0.2, 0.1, 0), 0.5, 1, 3));
  Specification spec = shell.SpecificationFor(0.2);
  spec.seeds = Eigen::Vector3d(0, 0, 1.02);
  const Boundary mesh = BoundaryOf(shell, spec);
  EXPECT_TRUE(mesh.report.certificate.certified) << mesh.report.certificate.verdict;
  EXPECT_EQ(stellate::testing::BettiNumbers(mesh.Of(1)), (std::vector<int>{2, 0, 2}));
}

TEST(BoundaryOnly, WrongAnswersAreNotCertified) {
  const Domain cube = stellate::testing::Cube();
  for (const int wrong : {0, 1, 2}) {
    Specification spec = cube.SpecificationFor(0.4);
    spec.boundary_only = true;
    spec.limits.max_rounds = 200;
    auto mesher = *Mesher::Create(spec);
    Domain m = cube;
    while (const auto batch = mesher->NextBatch()) {
      Answers answers = m.AnswersOf(*batch);
      for (std::size_t b = 0; b < answers.blocks.size(); ++b) {
        AnswerBlock& block = answers.blocks[b];
        // Conormals that point inwards, on one wall; a wall whose sign is wrong; one that is off.
        if (wrong == 0 && batch->blocks[b].face == 1) block.conormals *= -1;
        if (wrong == 1) block.clearances.row(2) *= -1;
        if (wrong == 2 && batch->blocks[b].face == 2 && batch->round > 12)
          block.points.array() += 0.1;
      }
      if (!mesher->Absorb(answers)) break;
    }
    EXPECT_FALSE(mesher->report().certificate.certified) << wrong;
  }
}

TEST(BoundaryOnly, DoesNotDependOnThreads) {
  const Arrangement venn = stellate::testing::SpaceArrangements()[5];
  const Specification spec = venn.SpecificationFor(0.4);
  const Boundary one = BoundaryOf(venn.domain, spec, {.threads = 1});
  const Boundary three = BoundaryOf(venn.domain, spec, {.threads = 3});
  EXPECT_EQ(one.points, three.points);
  EXPECT_EQ(one.simplices, three.simplices);
}

TEST(BoundaryOnly, NeedsABoundary) {
  Specification spec = stellate::testing::Arc().SpecificationFor(0.2);
  spec.boundary_only = true;
  EXPECT_EQ(Validate(spec).field, "boundary_only");
  spec = stellate::testing::Ball().SpecificationFor(0.2);
  spec.boundary_only = true;
  EXPECT_TRUE(Validate(spec).ok());
  spec.components = 1;
  EXPECT_TRUE(Validate(spec).ok());
  spec = stellate::testing::Hemisphere().SpecificationFor(0.2);
  spec.boundary_only = true;
  spec.components = 1;
  EXPECT_EQ(Validate(spec).field, "components");
}

INSTANTIATE_TEST_SUITE_P(OfSolids, BoundaryOnlyTest,
                         ::testing::Combine(::testing::ValuesIn(Cases()),
                                            ::testing::Values(0u, 1u, 2u)),
                         [](const auto& info) {
                           return std::get<0>(info.param).name +
                                  std::to_string(std::get<1>(info.param));
                         });

}  // namespace
}  // namespace stellate::core
