#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "mesh/write_file.h"
#include "mesh_file_fixture.h"
#include "stellate/mesh.h"

namespace stellate {
namespace {

TEST_F(MeshFile, TxtHoldsEveryDigit) {
  EXPECT_EQ(Saved(Surface(3), "a.txt"),
            "2 3 4 4\n"
            "0 0 0\n"
            "0.33333333333333331 0 0\n"
            "0 -1e-300 0\n"
            "0 0 12345678.9\n"
            "0 1 2\n0 1 3\n0 2 3\n1 2 3\n");
}

TEST_F(MeshFile, TxtTakesAnyDimension) {
  Mesh mesh;
  mesh.points = Eigen::MatrixXd::Identity(7, 5);
  mesh.simplices = SimplexMatrix(5, 1);
  mesh.simplices << 0, 1, 2, 3, 4;
  const std::string text = Saved(mesh, "a.txt");
  EXPECT_EQ(text.substr(0, text.find('\n')), "4 7 5 1");
  EXPECT_NE(text.find("\n0 1 2 3 4\n"), std::string::npos);
}

TEST_F(MeshFile, OffKeepsAllCoordinates) {
  const std::string three = Saved(Surface(3), "a.off"), five = Saved(Surface(5), "b.off");
  EXPECT_EQ(three.rfind("OFF\n4 4 0\n", 0), 0u) << three;
  EXPECT_EQ(five.rfind("nOFF\n5\n4 4 0\n0 0 0 0 0\n", 0), 0u) << five;
}

std::vector<std::vector<int>> LinesAfter(const std::string& text, const std::string& prefix) {
  std::vector<std::vector<int>> result;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(prefix, 0) != 0) continue;
    std::istringstream numbers(line.substr(prefix.size()));
    result.emplace_back(std::istream_iterator<int>(numbers), std::istream_iterator<int>());
  }
  return result;
}

TEST_F(MeshFile, ObjIsOrientedAndCountsFromOne) {
  const std::string text = Saved(Surface(3), "a.obj");
  const auto faces = LinesAfter(text, "f ");
  ASSERT_EQ(faces.size(), 4u);
  ExpectEdgesCancel(faces);
  for (const auto& face : faces) {
    for (const int id : face) EXPECT_TRUE(1 <= id && id <= 4);
  }
  EXPECT_NE(text.find("v 0.33333333333333331 0 0\n"), std::string::npos);
}

TEST_F(MeshFile, CurvesOfThePlaneGetAThirdCoordinate) {
  Mesh mesh;
  mesh.points = Eigen::MatrixXd::Identity(2, 2);
  mesh.simplices = SimplexMatrix(2, 1);
  mesh.simplices << 0, 1;
  EXPECT_EQ(Saved(mesh, "a.obj"), "v 1 0 0\nv 0 1 0\nl 1 2\n");
  const std::string ply = Saved(mesh, "a.ply");
  const std::string head =
      "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty double x\n"
      "property double y\nproperty double z\nelement edge 1\nproperty int vertex1\n"
      "property int vertex2\nend_header\n";
  ASSERT_EQ(ply.substr(0, head.size()), head);
  ASSERT_EQ(ply.size(), head.size() + 6 * sizeof(double) + 2 * sizeof(std::int32_t));
  double points[6];
  std::int32_t ids[2];
  std::memcpy(points, ply.data() + head.size(), sizeof points);
  std::memcpy(ids, ply.data() + head.size() + sizeof points, sizeof ids);
  EXPECT_THAT(points, ::testing::ElementsAre(1, 0, 0, 0, 1, 0));
  EXPECT_THAT(ids, ::testing::ElementsAre(0, 1));
}

TEST_F(MeshFile, PlyHoldsFaces) {
  const std::string text = Saved(Surface(3), "a.ply");
  EXPECT_EQ(text.rfind("ply\nformat binary_little_endian 1.0\nelement vertex 4\n", 0), 0u);
  const std::string last = "element face 4\nproperty list uchar int vertex_indices\nend_header\n";
  const size_t points = text.find(last) + last.size();
  const size_t rows = points + 12 * sizeof(double);
  ASSERT_EQ(text.size(), rows + 4 * 13);
  double first[3];
  std::memcpy(first, text.data() + points, sizeof first);
  EXPECT_EQ(first[0], Surface(3).points(0, 0));
  std::vector<std::vector<int>> faces;
  for (size_t at = rows; at < text.size(); at += 13) {
    EXPECT_EQ(text[at], 3);
    std::int32_t ids[3];
    std::memcpy(ids, text.data() + at + 1, sizeof ids);
    faces.push_back({ids[0], ids[1], ids[2]});
  }
  ExpectEdgesCancel(faces);
}

// A tetrahedron cut at a point within: three of the four are turned inside out by ascending
// numbers.
TEST_F(MeshFile, ASolidIsItsSurfaceInFormatsOfTriangles) {
  Mesh solid;
  solid.points.resize(3, 5);
  solid.points << 0, 0.2, 1, 0, 0, 0, 0.2, 0, 1, 0, 0, 0.2, 0, 0, 1;
  solid.simplices = SimplexMatrix(4, 4);
  solid.simplices << 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4;
  std::istringstream off(Saved(solid, "a.off"));
  std::string word;
  int points = 0, triangles = 0, none = 0;
  off >> word >> points >> triangles >> none;
  EXPECT_EQ(points, 4);  // without the one within
  ASSERT_EQ(triangles, 4);
  Eigen::Matrix3Xd at(3, points);
  for (double& coordinate : at.reshaped()) off >> coordinate;
  double volume = 0;
  for (int j = 0; j < triangles; ++j) {
    int three = 0, a = 0, b = 0, c = 0;
    off >> three >> a >> b >> c;
    ASSERT_EQ(three, 3);
    volume += at.col(a).dot(at.col(b).cross(at.col(c))) / 6;
  }
  EXPECT_NEAR(volume, 1.0 / 6, 1e-12);  // outwards
  EXPECT_EQ(Saved(solid, "a.stl").size(), 84u + 4 * 50);
  EXPECT_NE(Saved(solid, "a.ply").find("element vertex 4\n"), std::string::npos);
  const std::string obj = Saved(solid, "a.obj");
  EXPECT_EQ(std::count(obj.begin(), obj.end(), 'f'), 4);
  EXPECT_TRUE(CheckSave(Path("b.stl"), 3, 3).has_value());
}

TEST_F(MeshFile, RefusesWhatAFormatCannotHold) {
  Mesh solid = Surface(3);
  solid.simplices = SimplexMatrix(4, 1);
  solid.simplices << 0, 1, 2, 3;
  solid.points = Surface(4).points;
  for (const std::string ending : {".off", ".ply", ".obj", ".stl", ".3mf", ".glb"}) {
    EXPECT_NE(Refusal(solid, "a" + ending).find("surfaces of solids in space, and"),
              std::string::npos)
        << ending;
  }
  EXPECT_NE(Refusal(Surface(4), "a.obj").find("in R^4"), std::string::npos);
  EXPECT_NE(Refusal(Surface(4), "a.ply").find("in R^4"), std::string::npos);
  Mesh thick = Surface(5);
  thick.simplices = SimplexMatrix::Zero(5, 0);
  EXPECT_NE(Refusal(thick, "a.vtu").find("dimension 4"), std::string::npos);
  EXPECT_NE(Refusal(thick, "a.stl").find("surfaces"), std::string::npos);
  EXPECT_NE(Refusal(thick, "a.wkt").find("'.wkt'"), std::string::npos);
  EXPECT_NE(Refusal(Surface(4), "a.stl").find("known for it: .txt .off .vtu .npz"),
            std::string::npos);
  EXPECT_NE(Refusal(Surface(4), "a.msh").find("points of space"), std::string::npos);
  EXPECT_NE(Refusal(thick, "a.msh").find("dimension 3 at most"), std::string::npos);
  EXPECT_NE(Refusal(thick, "plain").find(".txt"), std::string::npos);
}

TEST_F(MeshFile, WhatWouldBeRefusedIsKnownBefore) {
  EXPECT_TRUE(CheckSave(Path("a.STL"), 2, 3).has_value());
  EXPECT_TRUE(CheckSave(Path("a.txt"), 7, 9).has_value());
  EXPECT_TRUE(CheckSave("in_this_folder.txt", 2, 3).has_value());
  for (const char* name : {"a.stl", "a.msh", "a.wkt", "missing/a.txt"}) {
    EXPECT_FALSE(CheckSave(Path(name), 2, 4).has_value()) << name;
  }
  std::filesystem::create_directory(Path("folder.txt"));
  EXPECT_FALSE(CheckSave(Path("folder.txt"), 2, 3).has_value());
  EXPECT_FALSE(std::filesystem::exists(Path("a.STL")));
}

TEST_F(MeshFile, MshIsGmshs) {
  Mesh mesh = Surface(3);
  mesh.points.rightCols(1).setConstant(0.5);
  EXPECT_EQ(Saved(mesh, "a.msh"),
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n"
            "2 0.33333333333333331 0 0\n3 0 -1e-300 0\n4 0.5 0.5 0.5\n$EndNodes\n"
            "$Elements\n4\n1 2 2 1 1 1 2 3\n2 2 2 1 1 1 4 2\n3 2 2 1 1 1 3 4\n"
            "4 2 2 1 1 2 4 3\n$EndElements\n");
}

TEST_F(MeshFile, StlHoldsTrianglesWithNormalsOutwards) {
  Mesh mesh = Surface(3);
  mesh.points.setZero();
  mesh.points.rightCols(3).setIdentity();
  mesh.points.colwise() += Eigen::Vector3d(5, 0, 0);  // the origin lies outside
  const std::string bytes = Saved(mesh, "a.stl");
  std::uint32_t count = 0;
  ASSERT_EQ(bytes.size(), 84u + 4 * 50);
  EXPECT_NE(bytes.substr(0, 5), "solid");
  std::memcpy(&count, bytes.data() + 80, sizeof count);
  EXPECT_EQ(count, 4u);
  const Eigen::Vector3f inside(5.1f, 0.1f, 0.1f);
  for (std::uint32_t i = 0; i < count; ++i) {
    Eigen::Matrix<float, 3, 4> facet;  // normal, corners
    std::memcpy(facet.data(), bytes.data() + 84 + 50 * i, sizeof facet);
    const Eigen::Vector3f across =
        (facet.col(2) - facet.col(1)).cross(facet.col(3) - facet.col(1)).normalized();
    EXPECT_LT((across - facet.col(0)).norm(), 1e-5f) << i;
    EXPECT_GT(across.dot(facet.col(1) - inside), 0) << i;
  }
  mesh.points.colwise() += Eigen::Vector3d(1e9, 0, 0);
  EXPECT_NE(Refusal(mesh, "b.stl").find("single precision"), std::string::npos);
}

TEST_F(MeshFile, PartsHaveTrianglesAndNamesThatXmlAndJsonTake) {
  Mesh mesh = Surface(3);
  mesh.points.setZero();
  mesh.points.rightCols(3).setIdentity();
  mesh.sides = {{1, 0}, {0, 1}, {1, 0}, {0, 1}};
  mesh.walls = {1, 1, 1, 1};
  mesh.region_names = {"<a> & \"b\""};
  const std::string glb = Saved(mesh, "a.glb");
  EXPECT_NE(glb.find(R"("name": "<a>_&__b__wall_0")"), std::string::npos) << glb;
  EXPECT_EQ(Saved(mesh, "a.3mf").substr(0, 4), "PK\3\4");
  mesh.points.colwise() += Eigen::Vector3d(1e9, 0, 0);
  EXPECT_NE(Refusal(mesh, "b.glb").find(".glb has single precision"), std::string::npos);
  mesh.simplices.resize(3, 0);
  for (const std::string ending : {".3mf", ".glb"})
    EXPECT_NE(Refusal(mesh, "b" + ending).find("no triangle, and " + ending), std::string::npos);
}

TEST_F(MeshFile, NastranHasAsManyDigitsAsFit) {
  Mesh mesh = Surface(3);
  mesh.points.resize(3, 4);
  mesh.points << -0.17355349564702321, -1.2345678901234567e-12, 1e22, 0.0001,  //
      1e-300, -1e6 / 3, -5e-324, 1e15,                                         //
      1.0, -0.0, 123456789.123456789, 1e16;
  mesh.labels = {1, 2, 2, 1};
  mesh.simplices.col(0) << 1, 2, 3;
  const std::string text = Saved(mesh, "a.nas");
  EXPECT_EQ(text.substr(0, text.find("CTRIA3")),
            "BEGIN BULK\n"
            "GRID*                  1                -1.7355349565E-11.000000000E-300*\n"
            "*                    1.0\n"
            "GRID*                  2                -1.234567890E-12-3.3333333333E+5*\n"
            "*                   -0.0\n"
            "GRID*                  3                1.0000000000E+22-4.94065646E-324*\n"
            "*       1.23456789123E+8\n"
            "GRID*                  4                          0.00011.0000000000E+15*\n"
            "*       1.0000000000E+16\n");
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1 + 8 + 4 + 1);
  EXPECT_EQ(Saved(mesh, "a.bdf"), text);
  EXPECT_EQ(Saved(mesh, "a.fem"), text);
  EXPECT_NE(Refusal(Surface(4), "b.nas").find(".nas holds points of space"), std::string::npos);
}

TEST_F(MeshFile, AFileIsReplacedWholeOrNotAtAll) {
  std::ofstream(Path("real.txt")) << "old";
  std::filesystem::permissions(Path("real.txt"), std::filesystem::perms::owner_all);
  std::filesystem::create_symlink("real.txt", Path("link.txt"));
  Saved(Surface(3), "link.txt");
  EXPECT_TRUE(std::filesystem::is_symlink(Path("link.txt")));
  EXPECT_EQ(std::filesystem::status(Path("real.txt")).permissions(),
            std::filesystem::perms::owner_all);
  EXPECT_GT(std::filesystem::file_size(Path("real.txt")), 3u);
  // A file may grow to this number of bytes: what does not fit leaves the old one.
  rlimit limit{}, before{};
  getrlimit(RLIMIT_FSIZE, &before);
  limit = before;
  limit.rlim_cur = 20;
  const auto ignored = signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &limit);
  std::ofstream(Path("small.txt")) << "old";
  const Expected<void> saved = Surface(3).Save(Path("small.txt"));
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, ignored);
  ASSERT_FALSE(saved.has_value());
  EXPECT_NE(saved.error().message.find("File too large"), std::string::npos);
  EXPECT_EQ(std::filesystem::file_size(Path("small.txt")), 3u);
  for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
    EXPECT_EQ(entry.path().string().find(".part-"), std::string::npos) << entry.path();
  }
}

TEST_F(MeshFile, AProcessThatIsKilledLeavesNothing) {
  const int nameless = open(directory_.c_str(), O_WRONLY | O_TMPFILE, 0600);
  if (nameless < 0) GTEST_SKIP() << "this file system has no files without names";
  close(nameless);
  const pid_t child = fork();
  if (child == 0) {
    Expected<client::Draft> draft = client::Draft::Begin(Path("a.txt"));
    if (draft && draft->Write("half") && draft->Keep()) raise(SIGKILL);
    _exit(1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_TRUE(std::filesystem::is_empty(directory_));
}

TEST_F(MeshFile, SaysWhyAFileCannotBeWritten) {
  EXPECT_NE(Refusal(Surface(3), "missing/a.txt").find("No such file"), std::string::npos);
}

}  // namespace
}  // namespace stellate
