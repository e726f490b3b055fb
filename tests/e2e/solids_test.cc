// Composed solids and materials, from C++ and from the command line through the real server;
// volumes and topology are counted here.
#include "stellate/solids.h"

#include <unistd.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>
#include <set>
#include <string>

#include "faces.h"
#include "live.h"
#include "program.h"
#include "stellate/download.h"
#include "stellate/serve.h"

namespace stellate::testing::compositions {
namespace {

using Eigen::Vector3d;
using solids::Ball, solids::Box, solids::Cylinder, solids::Labels, solids::Solid;

const Vector3d kOne = Vector3d::Ones(), kX = Vector3d::UnitX();

double Volume(const Mesh& mesh) {
  double volume = 0;
  Eigen::Matrix3d sides;
  for (const auto& simplex : mesh.simplices.colwise()) {
    for (int i = 0; i < 3; ++i) {
      sides.col(i) = mesh.points.col(simplex[i + 1]) - mesh.points.col(simplex[0]);
    }
    volume += std::abs(sides.determinant()) / 6;
  }
  return volume;
}

class SolidsFromCpp : public Live {};

// The first example of constructive solid geometry, by ten half-walls.
TEST_F(SolidsFromCpp, AnIntersectionIsMeshedByItsHalfWalls) {
  Solid part = (Box(-kOne, kOne) & Ball(1.3)) -
               (Cylinder(0.5, {}, kX) | Cylinder(0.5, 4, Vector3d::UnitY()) | Cylinder(0.5));
  const Expected<Mesh> mesh = MeshManifold(part, At(0.2));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.text;
  EXPECT_TRUE(mesh->labels.empty());
  EXPECT_EQ(Euler(mesh->simplices), -4);
  EXPECT_EQ(mesh->boundary().size(), 10u);
  EXPECT_EQ(All(mesh->boundary()), Rim(mesh->simplices));
  const std::vector<oracles::Wall> walls = part.HalfWalls();
  for (const Face& edge : mesh->edges()) {
    for (const int wall : edge.walls) {
      for (const std::uint32_t vertex : edge.simplices.reshaped()) {
        EXPECT_LT(std::abs(walls[static_cast<size_t>(wall)].g(mesh->points.col(vertex))), 1e-9);
      }
    }
  }
}

// Two balls of radius 1 whose centres are 1 apart have a lens of 5 pi / 12 in common.
TEST_F(SolidsFromCpp, AUnionIsMeshedByLabels) {
  Solid both = Ball() | Ball(1, kX);
  const Expected<Mesh> mesh = MeshManifold(both, At(0.25));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.text;
  EXPECT_EQ(Euler(mesh->simplices), 1);
  EXPECT_EQ(std::set<int>(mesh->labels.begin(), mesh->labels.end()), std::set<int>{1});
  EXPECT_EQ(mesh->labels.size(), static_cast<size_t>(mesh->simplices.cols()));
  const double exact = std::numbers::pi * (8.0 / 3 - 5.0 / 12);
  EXPECT_GT(Volume(*mesh), 0.92 * exact);
  EXPECT_LT(Volume(*mesh), exact);
  for (Eigen::Index j = 0; j < mesh->points.cols(); ++j) {
    const Vector3d x = mesh->points.col(j);
    EXPECT_LT(std::min(x.norm(), (x - kX).norm()), 1 + 1e-9);
  }
}

TEST_F(SolidsFromCpp, MaterialsAreRegionsInMeshesDownloadsAndFiles) {
  Labels composite({{"matrix", Box(-kOne, kOne)}, {"grain", Ball(0.6)}});
  const Expected<std::string> name = DeclareMesh(composite, At(0.25));
  ASSERT_TRUE(name.has_value()) << name.error().message;
  ServeOptions serve;
  serve.connection.server = Server();
  ASSERT_TRUE(ServeMesh(composite, *name, serve).has_value());
  DownloadOptions download;
  download.connection.server = Server();
  download.unfinished = Unfinished::kWait;
  const Expected<Mesh> fetched = DownloadMesh(*name, download);
  ASSERT_TRUE(fetched.has_value()) << fetched.error().message;
  const Expected<Mesh> mesh = MeshManifold(composite, At(0.25));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.text;
  EXPECT_TRUE(AreIdentical(*fetched, *mesh));
  EXPECT_EQ(fetched->labels, mesh->labels);
  // Of the grain 4 pi / 3 * 0.6^3, and 8 of all, which has plane sides.
  const Mesh matrix = mesh->Region(composite.LabelOf("matrix"));
  const Mesh grain = mesh->Region(composite.LabelOf("grain"));
  EXPECT_NEAR(Volume(grain), 4 * std::numbers::pi / 3 * 0.216, 0.09);
  EXPECT_NEAR(Volume(matrix) + Volume(grain), 8, 1e-9);
  EXPECT_EQ(matrix.simplices.cols() + grain.simplices.cols(), mesh->simplices.cols());
  EXPECT_EQ(Euler(grain.simplices), 1);
  EXPECT_EQ(Euler(matrix.simplices), 2);
  ASSERT_EQ(mesh->report.certificate.regions.size(), 2u);
  EXPECT_EQ(mesh->report.certificate.regions[1].simplices,
            static_cast<std::uint64_t>(grain.simplices.cols()));
  // What lies between the regions is a face, and not where the mesh ends.
  EXPECT_EQ(mesh->boundary().size(), 6u);
  ASSERT_EQ(mesh->faces(2).size(), 7u);
  EXPECT_EQ(All({mesh->faces(2)[6]}), Rim(grain.simplices));
  EXPECT_THROW(mesh->Region(3), std::invalid_argument);
  EXPECT_EQ(mesh->region_names, composite.names());
  EXPECT_EQ(fetched->region_names, composite.names());
}

// Three grains about as many centres: the largest function is that of the nearest one.
TEST_F(SolidsFromCpp, PhasesMeetAlongAnEdge) {
  const std::vector<Vector3d> centres = {
      {0.98, 0.2, 0.02}, {-0.67, 0.75, 0.23}, {-0.3, -0.95, 0.44}};
  std::vector<solids::Phase> grains;
  for (const Vector3d& centre : centres)
    grains.push_back({[centre](const Eigen::VectorXd& x) { return -(x - centre).squaredNorm(); }});
  grains[2].name = "salt";
  solids::Phases phases(grains, Ball());
  const Expected<Mesh> mesh = MeshManifold(phases, At(0.25));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.text;
  EXPECT_EQ(mesh->region_names, (std::vector<std::string>{"", "", "salt"}));
  double volume = 0;
  for (int label = 1; label <= 3; ++label) {
    const Mesh grain = mesh->Region(label);
    EXPECT_EQ(Euler(grain.simplices), 1);
    volume += Volume(grain);
    for (const auto& simplex : grain.simplices.colwise()) {
      Vector3d middle = Vector3d::Zero();
      for (const std::uint32_t id : simplex) middle += mesh->points.col(id) / 4;
      EXPECT_EQ(phases.LabelAt(middle), label);
    }
  }
  EXPECT_NEAR(volume, 4 * std::numbers::pi / 3, 0.3);
  // Of the three edges on the ball and the one inside, this is where all three walls are zero.
  int inner = 0;
  for (const Face& edge : mesh->edges()) {
    if (edge.walls != Walls{0, 1, 2}) continue;
    ++inner;
    for (const std::uint32_t id : edge.simplices.reshaped()) {
      const Vector3d x = mesh->points.col(id);
      EXPECT_NEAR((x - centres[0]).norm(), (x - centres[1]).norm(), 1e-9);
      EXPECT_NEAR((x - centres[0]).norm(), (x - centres[2]).norm(), 1e-9);
    }
  }
  EXPECT_EQ(inner, 1);
}

// The boundary alone has the labels on both sides, closed surfaces of regions, creases and groups.
TEST_F(SolidsFromCpp, TheBoundaryAloneHasSidesAndCreases) {
  Labels composite({{"matrix", Box(-kOne, kOne)}, {"grain", Ball(0.6)}});
  MeshOptions options = At(0.25);
  options.boundary_only = true;
  const Expected<Mesh> mesh = MeshManifold(composite, options);
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.text;
  ASSERT_TRUE(mesh->is_boundary());
  ASSERT_EQ(static_cast<Eigen::Index>(mesh->sides.size()), mesh->simplices.cols());
  EXPECT_TRUE(mesh->labels.empty());
  EXPECT_EQ(mesh->dimension(), 2);
  EXPECT_EQ(mesh->boundary().size(), 7u);
  EXPECT_EQ(mesh->edges().size(), 12u);
  EXPECT_EQ(mesh->corners().size(), 8u);
  // By the divergence theorem, from each triangle turned outwards.
  const auto enclosed = [](const Mesh& surface) {
    double sum = 0;
    const SimplexMatrix outwards = OrientedSimplices(surface);
    for (Eigen::Index j = 0; j < outwards.cols(); ++j) {
      Eigen::Matrix3d corners;
      for (int i = 0; i < 3; ++i) corners.col(i) = surface.points.col(outwards(i, j));
      sum += corners.determinant() / 6;
    }
    return sum;
  };
  // Inscribed into the sphere, with circumradii of up to 0.42 radii.
  const double grain = 4 * std::numbers::pi / 3 * 0.216, inscribed = enclosed(mesh->Region(2));
  EXPECT_LT(inscribed, grain);
  EXPECT_GT(inscribed, 0.8 * grain);
  EXPECT_NEAR(enclosed(mesh->Region(1)) + inscribed, 8, 1e-12);
  EXPECT_THROW(mesh->Region(0), std::invalid_argument);
  const std::string path = ::testing::TempDir() + "boundary.msh";
  ASSERT_TRUE(mesh->Save(path).has_value());
  std::ifstream file(path);
  const std::string text(std::istreambuf_iterator<char>(file), {});
  for (const char* name : {"\"wall_0\"", "\"wall_6\"", "\"walls_0_2\"", "\"walls_0_2_4\""})
    EXPECT_NE(text.find(name), std::string::npos) << name;
}

// The simplices of each group, by its name, and the corners' coordinates, of a .msh file.
struct Groups {
  explicit Groups(const std::string& path) {
    std::ifstream file(path);
    std::string word;
    while (file >> word && word != "$PhysicalNames") {
    }
    size_t count = 0;
    file >> count;
    std::map<int, std::string> names;
    for (size_t i = 0; i < count; ++i) {
      int dimension = 0, tag = 0;
      file >> dimension >> tag >> word;
      names[tag] = word.substr(1, word.size() - 2);
    }
    while (file >> word && word != "$Nodes") {
    }
    file >> count;
    for (size_t i = 0; i < count; ++i) {
      size_t number = 0;
      Vector3d x;
      file >> number >> x[0] >> x[1] >> x[2];
      points.push_back(x);
    }
    while (file >> word && word != "$Elements") {
    }
    file >> count;
    const std::map<int, size_t> corners = {{15, 1}, {1, 2}, {2, 3}, {4, 4}};
    for (size_t i = 0; i < count; ++i) {
      int number = 0, type = 0, tags = 0, tag = 0, entity = 0;
      file >> number >> type >> tags >> tag >> entity;
      std::vector<size_t> ids(corners.at(type));
      for (size_t& id : ids) {
        file >> id;
        --id;
      }
      simplices[names[tag]].push_back(ids);
    }
  }

  std::vector<Vector3d> points;
  std::map<std::string, std::vector<std::vector<size_t>>> simplices;
};

std::string Temporary(const std::string& name) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("stellate-solids-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  return (folder / name).string();
}

TEST_F(CommandLine, SolidsInWordsAreMeshed) {
  const std::string path = Temporary("part.msh");
  const Result result = OnServer(
      "mesh --solid \"box(-1,1) & ball(1.3) - cylinder(x, .5) | ball(.45, at=(.95,.9,.2))\" -e .2 "
      "-o " +
      path);
  EXPECT_EQ(result.status, 0) << result.output;
  EXPECT_NE(result.output.find("certificate  CERTIFIED"), std::string::npos) << result.output;
  const Groups groups(path);
  EXPECT_GT(groups.simplices.at("inside").size(), 500u);
  for (const Vector3d& x : groups.points) {
    const bool block = x.cwiseAbs().maxCoeff() < 1 + 1e-9 && x.norm() < 1.3 + 1e-9 &&
                       x.tail(2).norm() > 0.5 - 1e-9;
    EXPECT_TRUE(block || (x - Vector3d(0.95, 0.9, 0.2)).norm() < 0.45 + 1e-9) << x.transpose();
  }
}

TEST_F(CommandLine, MaterialsAreGroupsOfFilesAndLaterOnesWin) {
  const std::string path = Temporary("composite.msh");
  const Result result = OnServer(
      "mesh --material \"matrix=box(-1, 1)\" --material \"grain=ball(0.6)\" -e 0.25 -o " + path);
  EXPECT_EQ(result.status, 0) << result.output;
  const Groups groups(path);
  EXPECT_EQ(groups.simplices.count("inside"), 0u);
  double grain = 0;
  for (const auto& ids : groups.simplices.at("grain")) {
    Eigen::Matrix3d sides;
    for (size_t i = 0; i < 3; ++i) {
      sides.col(static_cast<int>(i)) = groups.points[ids[i + 1]] - groups.points[ids[0]];
    }
    EXPECT_GT(sides.determinant(), 0);
    grain += sides.determinant() / 6;
  }
  EXPECT_NEAR(grain, 4 * std::numbers::pi / 3 * 0.216, 0.09);
  // Outwards of the lower label, the matrix: into the grain, all of them.
  EXPECT_GT(groups.simplices.at("wall_6").size(), 50u);
  for (const auto& ids : groups.simplices.at("wall_6")) {
    const Vector3d a = groups.points[ids[0]], b = groups.points[ids[1]], c = groups.points[ids[2]];
    EXPECT_LT((b - a).cross(c - a).dot(a + b + c), 0);
  }
}

TEST_F(CommandLine, WrongSolidsAreRefusedWithTheirColumn) {
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {"--solid \"box(-1,1) & bal(1.3)\"",
       "--solid: column 13: expected a solid: ball, box, halfspace, cylinder, cone, torus, capsule "
       "or "
       "blend, ~ or a parenthesis, and there is 'bal'\n  box(-1,1) & bal(1.3)\n              ^\n"},
      {"--material \"a=ball(x)\"",
       "--material a: column 6: the radius of ball has to be a number, and is 'x'\n  ball(x)\n     "
       "  "
       "^\n"},
      {"--material \"ball(1)\"", "has to be NAME=SOLID"},
      {"--material \"a b=ball(1)\"", "the name of letters"},
      {"--material \"a=ball(.2)\" --material \"b=ball(1)\"", "nothing of the material 'a'"},
      {"--solid \"cylinder(1)\"", "goes on without end"},
      {"torus --solid \"ball(1)\"", "excludes"},
      {"--solid \"ball(1)\" --material \"a=ball(1)\"", "excludes"},
      {"--solid \"ball(1)\" --clip ball:0,0,0:1", "excludes"},
  };
  for (const auto& [arguments, words] : wrong) {
    const Result result = OnServer("mesh " + arguments + " -e 0.3");
    EXPECT_EQ(result.status, 2) << arguments << "\n" << result.output;
    EXPECT_NE(result.output.find(words), std::string::npos) << arguments << "\n" << result.output;
  }
}

TEST_F(CommandLine, TheDoctorAndWorkersTakeSolids) {
  const Result doctor = Run("doctor --solid \"ball() | ball(at=(1,0,0))\"");
  EXPECT_EQ(doctor.status, 0) << doctor.output;
  const Result declared = OnServer("declare --solid \"ball() - ball(0.5)\" -e 0.2");
  ASSERT_EQ(declared.status, 0) << declared.output;
  const std::string name = declared.output.substr(0, declared.output.find('\n'));
  const Result served = OnServer("serve " + name + " --solid \"ball() - ball(0.5)\"");
  EXPECT_EQ(served.status, 0) << served.output;
  EXPECT_NE(served.output.find("SUCCEEDED"), std::string::npos) << served.output;
}

}  // namespace
}  // namespace stellate::testing::compositions
