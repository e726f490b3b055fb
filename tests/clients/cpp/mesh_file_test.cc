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
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "mesh/groups.h"
#include "mesh/piece.h"
#include "mesh/write_file.h"
#include "mesh/zip.h"
#include "stellate/mesh.h"

namespace stellate {
namespace {

class MeshFile : public ::testing::Test {
 protected:
  void SetUp() override {
    const ::testing::TestInfo* info = ::testing::UnitTest::GetInstance()->current_test_info();
    directory_ = std::filesystem::temp_directory_path() /
                 ("stellate-mesh-file-" + std::to_string(getpid()) + "-" + info->name());
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::string Path(const std::string& name) const { return (directory_ / name).string(); }
  std::string Saved(const Mesh& mesh, const std::string& name) {
    const Expected<void> saved = mesh.Save(Path(name));
    EXPECT_TRUE(saved.has_value()) << saved.error().message;
    std::ifstream file(Path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  std::string Refusal(const Mesh& mesh, const std::string& name) {
    const Expected<void> saved = mesh.Save(Path(name));
    EXPECT_FALSE(saved.has_value());
    EXPECT_FALSE(std::filesystem::exists(Path(name)));
    if (saved) return "";
    EXPECT_EQ(saved.error().code, ErrorCode::kFileFailed);
    return saved.error().message;
  }

  std::filesystem::path directory_;
};

// The exit status of a line of Python with that argument.
int InPython(const std::string& line, const std::string& argument) {
  const std::string command =
      "/usr/bin/python3 -B -c \"import sys; " + line + "\" '" + argument + "'";
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

// A tetrahedron's boundary in R^d, with numbers that do not fit into few digits.
Mesh Surface(int d) {
  Mesh mesh;
  mesh.points = Eigen::MatrixXd::Zero(d, 4);
  mesh.points(0, 1) = 1.0 / 3;
  mesh.points(1, 2) = -1e-300;
  mesh.points(d - 1, 3) = 12345678.9;
  mesh.simplices.resize(3, 4);
  mesh.simplices << 0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3;
  return mesh;
}

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

// The faces of an oriented closed surface pass each edge once in each direction.
void ExpectEdgesCancel(const std::vector<std::vector<int>>& faces) {
  std::map<std::pair<int, int>, int> passed;
  for (const std::vector<int>& face : faces) {
    ASSERT_EQ(face.size(), 3u);
    for (size_t i = 0; i < 3; ++i) ++passed[{face[i], face[(i + 1) % 3]}];
  }
  for (const auto& [edge, count] : passed) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ((passed.count({edge.second, edge.first})), 1u);
  }
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

// The byte count and the bytes of a VTU data array that is inline, from base64.
std::string InlineBytes(const std::string& xml, size_t array) {
  const size_t start = xml.find('>', array) + 1;
  std::string bytes;
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : xml.substr(start, xml.find('<', start) - start)) {
    if (c == '=') break;
    const int digit = c >= 'a'   ? c - 'a' + 26
                      : c >= 'A' ? c - 'A'
                      : c == '+' ? 62
                      : c == '/' ? 63
                                 : c - '0' + 52;
    bits = bits << 6 | static_cast<std::uint32_t>(digit);
    held += 6;
    if (held >= 8) {
      held -= 8;
      bytes += static_cast<char>(bits >> held & 0xff);
    }
  }
  return bytes;
}

// The same, raw, of one that is among the appended data, with what follows it.
std::string AppendedBytes(const std::string& xml, const std::string& tag, size_t unit) {
  const size_t data = xml.find('_', xml.find("<AppendedData encoding=\"raw\">")) + 1;
  const std::string offset = "offset=\"";
  const size_t place = std::stoul(tag.substr(tag.find(offset) + offset.size()));
  EXPECT_EQ((data + place) % unit, 0u) << "can be mapped into memory: " << tag;
  return xml.substr(data + place);
}

// The numbers of a VTU data array.
template <typename Number>
std::vector<Number> VtuNumbers(const std::string& xml, const std::string& name) {
  const size_t array = xml.find("Name=\"" + name + "\"");
  EXPECT_NE(array, std::string::npos) << name;
  if (array == std::string::npos) return {};
  const std::string tag = xml.substr(array, xml.find('>', array) - array);
  const std::string bytes = tag.find("\"appended\"") == std::string::npos
                                ? InlineBytes(xml, array)
                                : AppendedBytes(xml, tag, sizeof(Number));
  std::uint64_t size = 0;
  std::memcpy(&size, bytes.data(), sizeof size);
  EXPECT_GE(bytes.size(), sizeof size + size);
  std::vector<Number> numbers(size / sizeof(Number));
  std::memcpy(numbers.data(), bytes.data() + sizeof size, size);
  return numbers;
}

TEST_F(MeshFile, VtuHoldsPointsAndCells) {
  const Mesh mesh = Surface(3);
  const std::string xml = Saved(mesh, "a.vtu");
  EXPECT_NE(xml.find("NumberOfPoints=\"4\" NumberOfCells=\"4\""), std::string::npos);
  const std::vector<double> points = VtuNumbers<double>(xml, "Points");
  EXPECT_EQ(points, std::vector<double>(mesh.points.data(), mesh.points.data() + 12));
  const auto ids = VtuNumbers<std::int64_t>(xml, "connectivity");
  ASSERT_EQ(ids.size(), 12u);
  std::vector<std::vector<int>> faces;
  for (size_t i = 0; i < 12; i += 3) {
    faces.push_back(
        {static_cast<int>(ids[i]), static_cast<int>(ids[i + 1]), static_cast<int>(ids[i + 2])});
  }
  ExpectEdgesCancel(faces);
  EXPECT_EQ(VtuNumbers<std::int64_t>(xml, "offsets"), (std::vector<std::int64_t>{3, 6, 9, 12}));
  EXPECT_EQ(VtuNumbers<std::uint8_t>(xml, "types"), (std::vector<std::uint8_t>{5, 5, 5, 5}));
  EXPECT_EQ(xml.find("coordinates"), std::string::npos);
}

TEST_F(MeshFile, VtuSaysWhatTheMeshIs) {
  Mesh mesh = Surface(3);
  EXPECT_EQ(Saved(mesh, "a.vtu").find("\"epsilon\""), std::string::npos);
  mesh.report.termination = Termination::kVertexBudget;
  mesh.report.epsilon = 0.1;
  mesh.report.certificate.verdict = "not certified: max_vertices is spent";
  const std::string xml = Saved(mesh, "a.vtu");
  EXPECT_EQ(VtuNumbers<double>(xml, "epsilon"), std::vector<double>{0.1});
  EXPECT_EQ(VtuNumbers<std::uint8_t>(xml, "certified"), std::vector<std::uint8_t>{0});
  const auto verdict = VtuNumbers<char>(xml, "verdict");
  EXPECT_EQ(std::string(verdict.begin(), verdict.end()), mesh.report.certificate.verdict);
  const auto version = VtuNumbers<char>(xml, "version");
  EXPECT_EQ(std::string(version.begin(), version.begin() + 9), "stellate ");
}

TEST_F(MeshFile, VtuKeepsHighCoordinatesAsData) {
  const Mesh mesh = Surface(6);
  const std::string xml = Saved(mesh, "a.vtu");
  EXPECT_EQ(VtuNumbers<double>(xml, "coordinates"),
            std::vector<double>(mesh.points.data(), mesh.points.data() + 24));
  EXPECT_EQ(VtuNumbers<double>(xml, "Points").size(), 12u);
}

// A tetrahedron cut at a point within: three of the four are turned inside out by ascending
// numbers.
TEST_F(MeshFile, PvtuIsOfManyProcesses) {
  EXPECT_NE(Refusal(Surface(3), "a.pvtu").find("stellate-mpi"), std::string::npos);
}

TEST_F(MeshFile, APieceHasTheSimplicesOfItsVerticesAndTheirPoints) {
  const Mesh mesh = Surface(4);
  const auto groups = client::GroupsOf(mesh);
  // The simplex 1 2 3; of no other is one of them the lowest vertex.
  Expected<client::Draft> piece = client::WritePiece(*client::Draft::Begin(Path("a.vtu")), mesh,
                                                     groups, {false, true, false, true});
  ASSERT_TRUE(piece.has_value()) << piece.error().message;
  EXPECT_FALSE(std::filesystem::exists(Path("a.vtu")));
  ASSERT_TRUE(piece->Finish().has_value());
  EXPECT_EQ(InPython("import meshio; m = meshio.read(sys.argv[1]); d = m.point_data; "
                     "assert d['GlobalPointIds'].ravel().tolist() == [1, 2, 3]; "
                     "assert d['coordinates'][2].tolist() == [0, 0, 0, 12345678.9]; "
                     "assert len(m.cells) == 1; "
                     "assert sorted(m.cells[0].data[0].tolist()) == [0, 1, 2]",
                     Path("a.vtu")),
            0);
}

TEST_F(MeshFile, APointWithoutSimplicesIsInThePieceOfItsOwner) {
  Mesh mesh = Surface(3);
  mesh.simplices = mesh.simplices.leftCols(1).eval();  // 0 1 2
  const auto groups = client::GroupsOf(mesh);
  for (const bool has_alone : {true, false}) {
    Expected<client::Draft> piece = client::WritePiece(*client::Draft::Begin(Path("a.vtu")), mesh,
                                                       groups, {true, false, false, has_alone});
    ASSERT_TRUE(piece.has_value() && piece->Finish().has_value());
    EXPECT_EQ(InPython("import meshio; d = meshio.read(sys.argv[1]).point_data; "
                       "assert d['GlobalPointIds'].ravel().tolist() == " +
                           std::string(has_alone ? "[0, 1, 2, 3]" : "[0, 1, 2]"),
                       Path("a.vtu")),
              0);
  }
}

TEST_F(MeshFile, AnIndexNamesPiecesBesideIt) {
  const client::PiecePaths paths(Path("a&b.pvtu"));
  EXPECT_EQ(paths.Piece(2), Path("a&b/a&b_2.vtu"));
  const Mesh mesh = Surface(3);
  const std::string index = paths.IndexOf(mesh, client::GroupsOf(mesh), 2);
  EXPECT_NE(index.find("<Piece Source=\"a&amp;b/a&amp;b_1.vtu\"/>"), std::string::npos);
  EXPECT_NE(index.find("<PPointData GlobalIds=\"GlobalPointIds\">"), std::string::npos);
  EXPECT_TRUE(paths.Check(2, 3, 0).has_value());
  EXPECT_FALSE(paths.Check(4, 5, 0).has_value());
  std::filesystem::create_directories(paths.Piece(1));
  EXPECT_TRUE(paths.Check(2, 3, 0).has_value());
  EXPECT_FALSE(paths.Check(2, 3, 1).has_value());
}

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

// Two tetrahedra, above and below a triangle of wall 1; all else is on wall 0.
TEST(Regions, AreGroupsAndWhatLiesBetweenIsAFaceTurnedOutOfTheLowerLabel) {
  Mesh mesh;
  mesh.points.resize(3, 5);
  mesh.points << 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, -1;
  mesh.simplices.resize(4, 2);
  mesh.simplices << 0, 0, 1, 1, 2, 2, 3, 4;
  mesh.walls = {3, 3, 3, 1, 1};
  for (const bool below_is_first : {true, false}) {
    mesh.labels =
        below_is_first ? std::vector<std::uint8_t>{7, 2} : std::vector<std::uint8_t>{2, 7};
    const std::vector<client::Group> groups = client::GroupsOf(mesh);
    ASSERT_GE(groups.size(), 4u);
    EXPECT_EQ(groups[0].name, "region_2");
    EXPECT_EQ(groups[1].name, "region_7");
    EXPECT_EQ(groups[0].simplices.cols(), 1);
    EXPECT_EQ(groups[0].simplices.col(0).maxCoeff(), below_is_first ? 4u : 3u);
    EXPECT_EQ(groups[2].name, "wall_0");
    EXPECT_EQ(groups[2].simplices.cols(), 6);
    EXPECT_EQ(groups[3].name, "walls_0_1");
    const SimplexMatrix& between = groups[3].simplices;
    ASSERT_EQ(between.cols(), 1);
    const Eigen::Vector3d a = mesh.points.col(between(0, 0)), b = mesh.points.col(between(1, 0)),
                          c = mesh.points.col(between(2, 0));
    EXPECT_EQ((b - a).cross(c - a)[2] > 0, below_is_first);
    EXPECT_EQ(mesh.boundary().size(), 1u);
    EXPECT_EQ(mesh.faces(2).size(), 2u);
    const Mesh region = mesh.Region(7);
    EXPECT_EQ(region.simplices.cols(), 1);
    EXPECT_EQ(region.boundary().size(), 2u);
  }
  try {
    mesh.Region(1);
    ADD_FAILURE() << "there is no region 1";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "the mesh has no region 1; it has [2, 7]");
  }
  mesh.labels = {2, 7};
  mesh.region_names = {"", "soft \"matrix\"", "", "", "", "", "grain"};
  EXPECT_EQ(client::GroupsOf(mesh)[0].name, "soft__matrix_");
  EXPECT_EQ(client::GroupsOf(mesh)[1].name, "grain");
  EXPECT_EQ(client::GroupsOf(mesh)[3].sides, (std::vector<Sides>{{2, 7}}));
  EXPECT_EQ(client::GroupsOf(mesh)[1].label, 7);
  mesh.region_names[1] = "grain";  // not to be told apart
  EXPECT_EQ(client::GroupsOf(mesh)[0].name, "region_2");
  mesh.region_names.clear();
  mesh.labels = {4, 4};  // one region: the inside
  EXPECT_EQ(client::GroupsOf(mesh)[0].name, "inside");
  EXPECT_EQ(mesh.faces(2).size(), 1u);
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

TEST_F(MeshFile, NpzHoldsNamesOfAnyCharacters) {
  Mesh mesh = Surface(3);
  mesh.labels = {1, 2, 1, 2};
  mesh.region_names = {"\xc3\xa9t\xc3\xa9", "", "\xff"};  // the last is no UTF-8
  Saved(mesh, "a.npz");
  EXPECT_EQ(
      InPython("import numpy; a = numpy.load(sys.argv[1]); names = a['region_names'].tolist(); "
               "sys.exit(names != ['\\xe9t\\xe9', '', '\\ufffd'] or a['labels'].tolist() != [1, 2, "
               "1, 2])",
               Path("a.npz")),
      0);
}

TEST_F(MeshFile, AnotherProgramReadsZipFilesOfBothKinds) {
  for (const std::uint64_t largest : {0xFFFFFFFEull, 200ull, 0ull}) {
    client::Zip zip(largest);
    std::string noise;
    std::uint64_t state = 1;
    for (int i = 0; i < 100'000; ++i)
      noise += static_cast<char>((state *= 6364136223846793005u) >> 60);
    zip.Add("empty", "");
    zip.Add("small", "abc");
    zip.Add("noise", noise);
    zip.Add("zeros", std::string(300'000, '\0'));
    zip.Add("last", "z");
    ASSERT_TRUE(client::WriteFile(Path("a.zip"), zip.Finish()).has_value());
    std::ofstream(Path("noise"), std::ios::binary) << noise;
    EXPECT_EQ(
        InPython("import zipfile; z = zipfile.ZipFile(sys.argv[1]); "
                 "noise = open(sys.argv[1][:-5] + 'noise', 'rb').read(); "
                 "wanted = [b'', b'abc', noise, bytes(300000), b'z']; "
                 "sys.exit(z.testzip() is not None or [z.read(n) for n in z.namelist()] != wanted)",
                 Path("a.zip")),
        0)
        << largest;
  }
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

TEST(OrientedSimplices, LeavesAOneSidedSurfaceAlone) {
  SimplexMatrix plane(3, 10);             // the six-vertex projective plane
  plane << 0, 0, 0, 0, 0, 1, 1, 1, 2, 2,  //
      1, 1, 2, 3, 4, 2, 3, 4, 3, 3,       //
      2, 3, 4, 5, 5, 5, 4, 5, 4, 5;
  EXPECT_EQ(OrientedSimplices(plane), plane);
}

TEST(OrientedSimplices, LeavesABranchingComplexAlone) {
  SimplexMatrix book(3, 3);  // three pages on one edge
  book << 0, 0, 0, 1, 1, 1, 2, 3, 4;
  EXPECT_EQ(OrientedSimplices(book), book);
}

TEST(OrientedSimplices, OrientsThreeSpheres) {
  // The boundary of the 4-simplex: signs must alternate with the vertex left out.
  SimplexMatrix sphere(4, 5);
  for (int drop = 0; drop < 5; ++drop) {
    for (int i = 0; i < 4; ++i) sphere(i, drop) = static_cast<std::uint32_t>(i < drop ? i : i + 1);
  }
  const SimplexMatrix oriented = OrientedSimplices(sphere);
  for (int j = 0; j < 5; ++j) {
    const bool swapped = oriented(2, j) > oriented(3, j);
    EXPECT_EQ(swapped, j % 2 == 1) << j;
  }
}

}  // namespace
}  // namespace stellate
