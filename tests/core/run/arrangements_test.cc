// Meshes of arrangements of walls: unions, differences, several materials. They are judged by the
// walls' functions alone, and by homology that does not share the mesher's code.

#include "tests/core/support/arrangements.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <iterator>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "core/mesher.h"
#include "tests/core/support/homology.h"

namespace stellate::core {
namespace {

using testing::Arrangement;
using testing::Complex;
using testing::Domain;

struct LabelledMesh {
  Report report;
  Eigen::MatrixXd points;
  std::map<int, Complex> regions;
};

// Why a mesh was not certified; empty if it was.
std::string WhyNot(const Expected<LabelledMesh>& mesh) {
  if (!mesh) return mesh.error().message;
  const Certificate& certificate = mesh->report.certificate;
  return certificate.certified ? "" : certificate.verdict;
}

using Change = std::function<void(const QueryBlock&, AnswerBlock*)>;

// `change`, if given, makes the answers wrong.
Expected<LabelledMesh> MeshOf(Domain domain, const Specification& spec,
                              const Change& change = nullptr, Execution execution = {}) {
  auto created = Mesher::Create(spec, execution);
  if (!created) return tl::unexpected<Status>(created.error());
  Mesher& mesher = **created;
  while (const auto batch = mesher.NextBatch()) {
    Answers answers = domain.AnswersOf(*batch);
    for (std::size_t b = 0; change && b < answers.blocks.size(); ++b)
      change(batch->blocks[b], &answers.blocks[b]);
    if (auto delta = mesher.Absorb(answers); !delta) return tl::unexpected<Status>(delta.error());
  }
  LabelledMesh mesh{mesher.report(), mesher.Points(), {}};
  const std::vector<std::uint32_t> ids = mesher.Simplices();
  const std::vector<std::int8_t> labels = mesher.Labels();
  const auto width = static_cast<std::size_t>(spec.dimension) + 1;
  for (std::size_t s = 0; s < labels.size(); ++s)
    mesh.regions[labels[s]].insert({ids.begin() + static_cast<std::ptrdiff_t>(s * width),
                                    ids.begin() + static_cast<std::ptrdiff_t>((s + 1) * width)});
  return mesh;
}

WallSet SignsAt(const Domain& domain, const Eigen::VectorXd& x) {
  WallSet signs = 0;
  for (std::size_t w = 0; w < domain.walls.size(); ++w)
    if (domain.walls[w](x, nullptr) >= 0) signs |= SetOfWall(static_cast<int>(w));
  return signs;
}

Eigen::VectorXd Barycentre(const LabelledMesh& mesh, const std::vector<std::uint32_t>& simplex) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(mesh.points.rows());
  for (const std::uint32_t v : simplex) sum += mesh.points.col(v);
  return sum / static_cast<double>(simplex.size());
}

double Volume(const LabelledMesh& mesh, const Complex& simplices) {
  double volume = 0;
  for (const auto& simplex : simplices) {
    const auto k = static_cast<Eigen::Index>(simplex.size()) - 1;
    Eigen::MatrixXd edges(mesh.points.rows(), k);
    for (Eigen::Index i = 0; i < k; ++i)
      edges.col(i) =
          mesh.points.col(simplex[static_cast<std::size_t>(i) + 1]) - mesh.points.col(simplex[0]);
    volume += std::sqrt(std::max((edges.transpose() * edges).determinant(), 0.0)) /
              std::tgamma(static_cast<double>(k) + 1);
  }
  return volume;
}

// The volume of each label in the box, by points on a grid.
std::map<int, double> VolumesByCounting(const Arrangement& a) {
  const int d = a.domain.d, steps = d == 2 ? 400 : 60;
  const Eigen::VectorXd width = a.domain.box.upper - a.domain.box.lower;
  std::map<int, double> volumes;
  std::vector<int> at(static_cast<std::size_t>(d), 0);
  const double each = width.prod() / std::pow(steps, d);
  for (;;) {
    Eigen::VectorXd x(d);
    for (int i = 0; i < d; ++i)
      x[i] = a.domain.box.lower[i] + width[i] * (at[static_cast<std::size_t>(i)] + 0.5) / steps;
    volumes[a.label(SignsAt(a.domain, x))] += each;
    std::size_t i = 0;
    while (i < at.size() && ++at[i] == steps) at[i++] = 0;
    if (i == at.size()) break;
  }
  volumes.erase(0);
  EXPECT_EQ(volumes.count(-1), 0u) << "signs that are called impossible";
  return volumes;
}

class ArrangementsTest : public ::testing::TestWithParam<std::tuple<Arrangement, unsigned>> {
 protected:
  void SetUp() override {
    const unsigned seed = std::get<1>(GetParam());
    domain = arrangement.domain.Turned(seed);
    spec = arrangement.SpecificationFor(arrangement.epsilon);
    spec.bounding_box = BoundingBox{domain.box.lower, domain.box.upper};
    spec.random_seed = seed + 1;
    mesh = MeshOf(domain, spec);
    ASSERT_TRUE(mesh) << mesh.error().message;
  }

  const Arrangement& arrangement = std::get<0>(GetParam());
  Domain domain;
  Specification spec;
  Expected<LabelledMesh> mesh;
};

TEST_P(ArrangementsTest, AreMeshedRegionByRegion) {
  const Certificate& certificate = mesh->report.certificate;
  EXPECT_TRUE(certificate.certified) << certificate.verdict;

  ASSERT_EQ(certificate.regions.size(), mesh->regions.size());
  for (const RegionReport& region : certificate.regions) {
    const Complex& simplices = mesh->regions.at(region.label);
    EXPECT_EQ(region.simplices, simplices.size());
    EXPECT_EQ(region.euler_characteristic, testing::EulerOf(simplices)) << region.label;
    EXPECT_NEAR(region.volume, Volume(*mesh, simplices), 1e-9 * region.volume);
    if (arrangement.domain.k < 3 || certificate.pinched_vertices == 0) {
      const std::vector<int> betti = testing::BettiNumbers(simplices);
      EXPECT_EQ(region.betti, std::vector<std::int64_t>(betti.begin(), betti.end()));
    }
    EXPECT_GT(region.min_dihedral_degrees, arrangement.domain.k == 2 ? 10 : 2) << region.label;
    EXPECT_LT(region.min_dihedral_degrees, 60);
    if (const auto known = arrangement.euler.find(region.label); known != arrangement.euler.end()) {
      EXPECT_EQ(region.euler_characteristic, known->second) << region.label;
    }
  }
  // Regions add up to all of M, and each interface is what two of them have in common.
  double together = 0;
  for (const RegionReport& region : certificate.regions) together += region.volume;
  EXPECT_NEAR(certificate.volume, together, 1e-9 * together);
  std::map<std::pair<int, int>, double> areas;
  for (const FaceReport& face : certificate.faces)
    if (face.dimension == arrangement.domain.k - 1)
      areas[std::minmax(face.sides.first, face.sides.second)] += face.volume;
  for (const auto& [sides, area] : areas) {
    if (sides.first == 0) continue;
    const auto facets = [&](int label) {
      return testing::FacesOf(
          mesh->regions.at(label))[static_cast<std::size_t>(arrangement.domain.k - 1)];
    };
    const Complex one = facets(sides.first), other = facets(sides.second);
    Complex common;
    std::set_intersection(one.begin(), one.end(), other.begin(), other.end(),
                          std::inserter(common, common.end()));
    EXPECT_NEAR(area, Volume(*mesh, common), 1e-9 * area);
  }
  // Each facet is in two simplices, or M ends there, on a wall.
  Complex all;
  for (const auto& [label, simplices] : mesh->regions)
    all.insert(simplices.begin(), simplices.end());
  for (const auto& facet : testing::RimOf(all)) {
    WallSet common = ~WallSet{0};
    for (const std::uint32_t v : facet)
      for (int w = 0; w < spec.walls; ++w)
        if (std::abs(domain.walls[static_cast<std::size_t>(w)](mesh->points.col(v), nullptr)) >
            1e-9)
          common &= ~SetOfWall(w);
    EXPECT_NE(common & (SetOfWall(spec.walls) - 1), 0u) << "a rim that is on no wall";
  }
}

// Only simplices at a curved wall may have their barycentre beyond it.
TEST_P(ArrangementsTest, HaveTheLabelsOfTheirPlaces) {
  for (const auto& [label, simplices] : mesh->regions)
    for (const auto& simplex : simplices) {
      const Eigen::VectorXd at = Barycentre(*mesh, simplex);
      WallSet unknown = 0;
      for (int w = 0; w < spec.walls; ++w)
        for (const std::uint32_t v : simplex)
          if (std::abs(domain.walls[static_cast<std::size_t>(w)](mesh->points.col(v), nullptr)) <
              1e-9)
            unknown |= SetOfWall(w);
      bool fits = false;
      for (WallSet part = 0; part < SetOfWall(spec.walls); ++part)
        fits = fits || (IsSubset(part, unknown) &&
                        arrangement.label((SignsAt(domain, at) & ~unknown) | part) == label);
      EXPECT_TRUE(fits) << "label " << label << " at " << at.transpose();
    }
  if (arrangement.domain.k < arrangement.domain.d) return;
  for (const auto& [label, volume] : VolumesByCounting(arrangement))
    EXPECT_NEAR(Volume(*mesh, mesh->regions.at(label)), volume, 0.13 * volume)
        << label;  // chords of what is round: an eighth of a ball whose radius is 2 epsilon
}

// Where a region touches itself alone, in the plane in two points and in space along a circle.
TEST(Arrangements, PinchedRegionsAreMeshedAndCalledSo) {
  for (const int d : {2, 3}) {
    const Arrangement pinched = testing::Pinched(d);
    const auto mesh = MeshOf(pinched.domain, pinched.SpecificationFor(0.3));
    ASSERT_TRUE(mesh) << mesh.error().message;
    const Certificate& certificate = mesh->report.certificate;
    EXPECT_TRUE(certificate.certified) << certificate.verdict;
    std::uint64_t on_both = 0;
    for (Eigen::Index v = 0; v < mesh->points.cols(); ++v)
      on_both += std::abs(pinched.domain.walls[0](mesh->points.col(v), nullptr)) < 1e-9 &&
                 std::abs(pinched.domain.walls[1](mesh->points.col(v), nullptr)) < 1e-9;
    EXPECT_EQ(certificate.pinched_vertices, on_both);
    EXPECT_GE(on_both, 2u);
    ASSERT_FALSE(certificate.warnings.empty());
    EXPECT_NE(certificate.warnings.front().find("Pinched at "), std::string::npos);
    // It is no manifold there, and the verdict does not say so.
    EXPECT_NE(
        certificate.verdict.find("except at " + std::to_string(on_both) + " vertices where it"),
        std::string::npos)
        << certificate.verdict;
    EXPECT_EQ(testing::EulerOf(mesh->regions.at(1)), d == 2 ? 0 : 2);
  }
}

// What of T^4 in R^8 is near a point, in two labels. Where stars of such a mesh disagreed a tiling
// that knows no labels filled the cavity: what was between the labels had holes.
TEST(Arrangements, FourDimensionsInCodimensionHaveLabels) {
  Arrangement torus;
  torus.domain.k = 4;
  torus.domain.d = 8;
  Eigen::VectorXd middle(8);
  middle << 1, 0, 1, 0, 1, 0, 1, 0;
  torus.domain.box = {(middle.array() - 0.9).matrix(), (middle.array() + 0.9).matrix()};
  for (int circle = 0; circle < 4; ++circle) {
    torus.domain.equations.push_back([circle](const Eigen::VectorXd& x, Eigen::VectorXd* gradient) {
      if (gradient) {
        gradient->setZero(8);
        gradient->segment(2 * circle, 2) = x.segment(2 * circle, 2);
      }
      return (x.segment(2 * circle, 2).squaredNorm() - 1) / 2;
    });
  }
  torus.domain.walls = {testing::HalfSpaceOf(middle / 2, -1.8),
                        testing::HalfSpaceOf(Eigen::VectorXd::Unit(8, 1), 0)};
  torus.label = [](auto s) { return s == 1 ? 1 : s == 3 ? 2 : 0; };
  const auto mesh = MeshOf(torus.domain, torus.SpecificationFor(0.45));
  EXPECT_EQ(WhyNot(mesh), "");
  ASSERT_TRUE(mesh.has_value());
  ASSERT_EQ(mesh->regions.size(), 2u);
  for (const auto& [label, region] : mesh->regions) EXPECT_EQ(testing::EulerOf(region), 1) << label;
}

// Closures that do not hold, and tables that call impossible what there is, are refuted by name.
TEST(Arrangements, WrongClosuresAreRefuted) {
  const Arrangement three = testing::PhaseArrangements()[0];
  Specification spec = three.SpecificationFor(0.3);
  Domain apart = three.domain;  // wall 1 passes beside where walls 0 and 2 meet
  apart.walls[1] = [f = apart.walls[1]](const Eigen::VectorXd& x, Eigen::VectorXd* gradient) {
    return f(x, gradient) + 0.15;
  };
  const std::string beside = WhyNot(MeshOf(apart, spec));
  EXPECT_NE(beside.find("closures say that walls 0, 1, 2 vanish together, but at ("),
            std::string::npos)
      << beside;

  const Arrangement cube = testing::SpaceArrangements()[6];  // walls 0, 2, 4 are independent
  spec = cube.SpecificationFor(0.3);
  spec.closures = {SetOfWall(0) | SetOfWall(2) | SetOfWall(4)};
  Domain domain = cube.domain;
  domain.closures = Closures(spec.closures);
  const std::string independent = WhyNot(MeshOf(domain, spec));
  EXPECT_NE(independent.find("closures say that walls 0, 2, 4 vanish together"), std::string::npos)
      << independent;

  const Arrangement venn = testing::PlaneArrangements()[2];
  spec = venn.SpecificationFor(0.3);
  spec.labels[3] = -1;
  const std::string impossible = WhyNot(MeshOf(venn.domain, spec));
  EXPECT_NE(impossible.find("labels say that no point has the signs ++"), std::string::npos)
      << impossible;
}

TEST(Arrangements, PhasesWithWrongSignsOrLabelsAreNotCertified) {
  const Arrangement three = testing::PhaseArrangements()[0];
  const auto flip = [](const QueryBlock&, AnswerBlock* answer) { answer->clearances.row(1) *= -1; };
  const auto flip_on_walls = [&](const QueryBlock& asked, AnswerBlock* answer) {
    if (asked.face != 0) flip(asked, answer);
  };
  Specification spec = three.SpecificationFor(0.3);
  spec.limits.max_rounds = 300;
  for (const Change& change : {Change(flip), Change(flip_on_walls)}) {
    const auto mesh = MeshOf(three.domain, spec, change);
    EXPECT_FALSE(mesh && mesh->report.certificate.certified);
  }
  // Labels of half of the orders permuted: in the table one phase is two.
  for (std::size_t signs = 0; signs < spec.labels.size(); ++signs)
    if (spec.labels[signs] == 1 && (signs & 4) != 0) spec.labels[signs] = 2;
  const auto mesh = MeshOf(three.domain, spec);
  if (!mesh) return;
  EXPECT_TRUE(!mesh->report.certificate.certified ||
              mesh->report.certificate.regions.size() == 3);  // it is what the table says
}

// A wall that passes beside a corner, and too near to tell whether it is meant to be in it.
TEST(Arrangements, WallsThatNearlyMeetInACornerAreNamed) {
  Arrangement pyramid = testing::CrowdedArrangements()[1];
  const auto side = pyramid.domain.walls[0];
  pyramid.domain.walls[0] = [side](const Eigen::VectorXd& x, Eigen::VectorXd* gradient) {
    return side(x, gradient) - 2e-5;
  };
  const std::string why = WhyNot(MeshOf(pyramid.domain, pyramid.SpecificationFor(0.2)));
  EXPECT_NE(why.find("walls 0, 1, 2, 3 meet in one point at ("), std::string::npos) << why;
  EXPECT_NE(why.find("or nearly so"), std::string::npos) << why;
}

// Whatever is wrong with the signs, nothing is certified, or refused as if it were right.
TEST(Arrangements, WrongSignsAreNotCertified) {
  const Arrangement venn = testing::PlaneArrangements()[2];
  const auto flip = [](const QueryBlock&, AnswerBlock* answer) { answer->clearances.row(1) *= -1; };
  const auto flip_inside = [&](const QueryBlock& asked, AnswerBlock* answer) {
    if (asked.face == 0) flip(asked, answer);
  };
  const auto flip_on_walls = [&](const QueryBlock& asked, AnswerBlock* answer) {
    if (asked.face != 0) flip(asked, answer);
  };
  const auto swap = [](const QueryBlock& asked, AnswerBlock* answer) {
    if (asked.face == 0) answer->clearances.row(0).swap(answer->clearances.row(1));
  };
  for (const Change& change :
       {Change(flip), Change(flip_inside), Change(flip_on_walls), Change(swap)}) {
    Specification spec = venn.SpecificationFor(0.3);
    spec.limits.max_rounds = 300;
    const auto mesh = MeshOf(venn.domain, spec, change);
    if (!mesh) {
      EXPECT_FALSE(mesh.error().message.empty());
      continue;
    }
    EXPECT_FALSE(mesh->report.certificate.certified) << mesh->report.certificate.verdict;
  }
}

// A table that knows nothing of a wall that is there: M is what the table says.
TEST(Arrangements, AWallThatNoLabelDependsOnIsNoConcern) {
  const Arrangement venn = testing::PlaneArrangements()[2];
  Specification spec = venn.SpecificationFor(0.3);
  spec.labels = {0, 1, 0, 1};
  const auto mesh = MeshOf(venn.domain, spec);
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certificate.certified) << mesh->report.certificate.verdict;
  ASSERT_EQ(mesh->regions.size(), 1u);
  EXPECT_NEAR(Volume(*mesh, mesh->regions.at(1)), 3.14159, 0.1);
}

// Two balls that nearly touch: each wall would cut the other's simplices without end.
TEST(Arrangements, WallsThatNearlyTouchAreNamed) {
  for (const double beside : {1.0002, 1.00002}) {
    SCOPED_TRACE(beside);
    Arrangement touching = testing::SpaceArrangements()[0];
    touching.domain.walls = {testing::InBall(Eigen::Vector3d(-beside, 0, 0), 1),
                             testing::InBall(Eigen::Vector3d(beside, 0, 0), 1)};
    touching.domain.box = testing::CubeOf(3, 2.2);
    Specification spec = touching.SpecificationFor(0.4);
    spec.limits.max_vertices = 20000;
    const auto mesh = MeshOf(touching.domain, spec);
    ASSERT_TRUE(mesh) << mesh.error().message;
    const Report& report = mesh->report;
    const std::string& verdict = report.certificate.verdict;
    EXPECT_FALSE(report.certificate.certified);
    EXPECT_EQ(report.termination, Termination::kNoProgress) << report.counts.vertices;
    EXPECT_NE(verdict.find("walls 0, 1 come so near each other near ("), std::string::npos)
        << verdict;
    EXPECT_EQ(verdict.find("smaller epsilon"), std::string::npos) << verdict;
    EXPECT_EQ(verdict.find("take epsilon"), std::string::npos) << verdict;
  }
}

// Changes add up to the mesh also while stars disagree about labels.
TEST(Arrangements, ChangesAddUpToTheMesh) {
  for (const Arrangement& a : {testing::SpaceArrangements()[5], testing::PlaneArrangements()[2]}) {
    const Specification spec = a.SpecificationFor(a.epsilon);
    auto created = Mesher::Create(spec);
    ASSERT_TRUE(created);
    Mesher& mesher = **created;
    Domain domain = a.domain;
    std::map<std::vector<std::uint32_t>, int> labels;
    const auto width = static_cast<std::size_t>(spec.dimension) + 1;
    const auto row = [&](const std::vector<std::uint32_t>& all, std::size_t s) {
      return std::vector<std::uint32_t>(all.begin() + static_cast<std::ptrdiff_t>(s * width),
                                        all.begin() + static_cast<std::ptrdiff_t>((s + 1) * width));
    };
    while (const auto batch = mesher.NextBatch()) {
      const auto delta = mesher.Absorb(domain.AnswersOf(*batch));
      ASSERT_TRUE(delta);
      for (std::size_t s = 0; s * width < delta->removed.size(); ++s)
        ASSERT_EQ(labels.erase(row(delta->removed, s)), 1u) << a.name << ' ' << delta->revision;
      for (std::size_t s = 0; s * width < delta->added.size(); ++s)
        ASSERT_TRUE(labels.emplace(row(delta->added, s), delta->labels[s]).second) << a.name;
      const std::vector<std::uint32_t> all = mesher.Simplices();
      const std::vector<std::int8_t> now = mesher.Labels();
      ASSERT_EQ(all.size() / width, labels.size()) << a.name << ' ' << delta->revision;
      for (std::size_t s = 0; s < now.size(); ++s) ASSERT_EQ(labels[row(all, s)], now[s]);
    }
  }
}

// The same mesh, bit for bit, for any number of threads.
TEST(Arrangements, DoNotDependOnThreads) {
  const Arrangement venn = testing::SpaceArrangements()[1];
  const Specification spec = venn.SpecificationFor(0.4);
  const auto one = MeshOf(venn.domain, spec, nullptr, {.threads = 1});
  const auto three = MeshOf(venn.domain, spec, nullptr, {.threads = 3});
  ASSERT_TRUE(one && three);
  EXPECT_EQ(one->points, three->points);
  EXPECT_EQ(one->regions, three->regions);
}

std::string NameOf(const ::testing::TestParamInfo<std::tuple<Arrangement, unsigned>>& info) {
  return std::get<0>(info.param).name + std::to_string(std::get<1>(info.param));
}
INSTANTIATE_TEST_SUITE_P(OfThePlane, ArrangementsTest,
                         ::testing::Combine(::testing::ValuesIn(testing::PlaneArrangements()),
                                            ::testing::Values(0u, 1u)),
                         NameOf);
INSTANTIATE_TEST_SUITE_P(OfPhases, ArrangementsTest,
                         ::testing::Combine(::testing::ValuesIn(testing::PhaseArrangements()),
                                            ::testing::Values(0u, 1u, 2u)),
                         NameOf);
INSTANTIATE_TEST_SUITE_P(OfCrowdedCorners, ArrangementsTest,
                         ::testing::Combine(::testing::ValuesIn(testing::CrowdedArrangements()),
                                            ::testing::Values(0u, 1u)),
                         NameOf);
INSTANTIATE_TEST_SUITE_P(OfSpace, ArrangementsTest,
                         ::testing::Combine(::testing::ValuesIn(testing::SpaceArrangements()),
                                            ::testing::Values(1u)),
                         NameOf);

}  // namespace
}  // namespace stellate::core
